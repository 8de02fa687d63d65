"""Fakes of the boundaries: an engine that walks without models, a stick body, a manual clock."""

import numpy as np

from wayfarer.body.landmarks import marker_names
from wayfarer.body.model import BodyModel
from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.runtime.persistence.capture import capture_session
from wayfarer.runtime.persistence.snapshot import join_agent
from wayfarer.spec import (
    BETAS,
    GENDERS,
    JOINTS,
    MARKERS,
    NEW_FRAMES,
    POSED_JOINTS,
    STEP_SECONDS,
)
from wayfarer.terms import TERMS
from wayfarer.world.agents.agent import (
    AgentSpec,
    AgentState,
    ChunkFlag,
    MotionChunk,
    SessionSpec,
)
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.heading import facing_of
from wayfarer.world.agents.records import AgentRecord, SessionRecord
from wayfarer.world.goals.steering import Steering
from wayfarer.world.observer import WorldObserver
from wayfarer.world.output.quaternion import multiply
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.world import World

HIPS_HEIGHT = 0.9
GOAL = Goal((0.0, 5.0, 0.0))
TURN = 0.4  # radians


class FakeEngine:
    """Moves the whole body towards the goal at the target speed, and turns it by up to TURN a step
    to the facing asked for; candidate 0's first latent number is a sideways nudge in millimetres,
    so the noise shows in the motion."""

    name = "fake"
    graphs = ("0" * 64, "1" * 64)
    term_names = TERMS

    def __init__(self) -> None:
        self.calls: list[tuple[str, int, int]] = []  # gender, rows, candidates
        self.fail_next = 0
        self.nan_for_beta: float | None = None  # rows with this first beta come out as NaN

    @property
    def single_threaded(self) -> "FakeEngine":
        return self

    @property
    def scoring(self) -> "FakeEngine":
        return self

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        agents, candidates = inputs.noise.shape[:2]
        self.calls.append((gender, agents, candidates))
        if self.fail_next:
            self.fail_next -= 1
            raise RuntimeError("the engine broke down")
        start = inputs.seed_translation[:, -1]
        way = inputs.goal[:, :2] - start[:, :2]
        distance = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
        length = np.minimum(inputs.target_speed[:, None] * STEP_SECONDS, distance)
        share = (np.arange(1, NEW_FRAMES + 1) / NEW_FRAMES)[None, :, None]
        move = np.zeros((agents, NEW_FRAMES, 3), np.float32)
        move[..., :2] = (way / distance * length)[:, None] * share
        move[..., 0] += inputs.noise[:, 0, 0, None] * 1e-3 * share[..., 0]
        if self.nan_for_beta is not None:
            move[inputs.betas[:, 0] == np.float32(self.nan_for_beta)] = np.nan
        return StepOutputs(
            translation=start[:, None] + move,
            rotations=np.repeat(_turned(inputs)[:, None], NEW_FRAMES, axis=1),
            contacts=np.ones((agents, NEW_FRAMES, 2), np.float32),
            next_seed_markers=inputs.seed_markers[:, -1:] + move[:, -2:, None],
            terms=np.zeros((agents, len(TERMS)), np.float32),
            choice=np.zeros(agents, np.int64),
        )


def _turned(inputs: StepInputs) -> np.ndarray:
    """The last seed frame's rotations [A, 22, 4], hips turned towards the facing asked for."""
    rotations = inputs.seed_rotations[:, -1].copy()
    now, asked = facing_of(rotations[:, 0]), inputs.facing
    angle = np.arctan2(now[:, 0] * asked[:, 1] - now[:, 1] * asked[:, 0], (now * asked).sum(-1))
    half = np.clip(angle, -TURN, TURN) / 2 * asked.any(-1)
    turns = np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], -1)
    rotations[:, 0] = [
        multiply(turn, hips) for turn, hips in zip(turns, rotations[:, 0], strict=True)
    ]
    return rotations


def stick_body(gender: str = "female") -> BodyModel:
    """Joints in one vertical chain; each marker is a separate vertex on one of them."""
    joints = np.zeros((JOINTS, 3))
    joints[0, 2] = HIPS_HEIGHT
    joints[1:, 2] = np.linspace(0.8, 0.1, JOINTS - 1)
    names = marker_names()
    downwards = sorted(range(MARKERS), key=lambda i: "SOLE" in names[i])  # soles are lowest
    vertices = np.zeros((MARKERS, 3))
    vertices[downwards, 2] = np.linspace(1.7, 0.0, MARKERS)
    vertices[:, 0] = 0.1
    parents = np.zeros(JOINTS, np.int64)
    parents[0] = -1
    bones = np.zeros((MARKERS, 4), np.int64)
    weights = np.tile([1.0, 0, 0, 0], (MARKERS, 1))
    return BodyModel(
        name="stick",
        gender=gender,
        joint_names=tuple(f"J{i}" for i in range(JOINTS)),
        parents=parents,
        bind_joints=joints,
        bind_joints_dirs=np.zeros((JOINTS, 3, BETAS)),
        bind_to_rest=np.tile(np.eye(3), (JOINTS, 1, 1)),
        bind_vertices=vertices,
        # the first beta makes the body taller, 10 cm per unit
        bind_vertices_dirs=np.einsum(
            "v,c,b->vcb", vertices[:, 2] / 17, [0, 0, 1], np.eye(BETAS)[0]
        ),
        skin_joints=bones,
        skin_weights=weights,
        faces=np.zeros((0, 3), np.int64),
        marker_names=names,
        marker_vertices=np.arange(MARKERS),
    )


BODIES = {gender: stick_body(gender) for gender in GENDERS}


def start_poses(count: int = 2) -> np.ndarray:
    """T-pose, then T-poses with one arm turned by some angle about X."""
    poses = np.zeros((count, 22, 4), np.float32)
    for i in range(count):
        poses[i, :, 3] = 1.0
        poses[i, 16] = [np.sin(0.1 * i), 0, 0, np.cos(0.1 * i)]
    return poses


def make_world(
    engine: FakeEngine | None = None, observer: WorldObserver | None = None, **settings: object
) -> World:
    settings = {"steering": Steering(reactions=1)} | settings  # nobody hesitates
    world = World(engine or FakeEngine(), BODIES, start_poses(), WorldSettings(**settings))
    if observer is not None:
        world.observe(observer)
    return world


def people(count: int, **values: object) -> list[AgentSpec]:
    """Agents 2 m apart along X with different noise seeds."""
    return [
        AgentSpec(
            **{
                "gender": GENDERS[i % 2],
                "position": (2.0 * i, 0.0),
                "noise_seed": i,
                **values,
            }
        )
        for i in range(count)
    ]


def motion_chunk(seq: int = 0, **changes: object) -> MotionChunk:
    """A chunk of a body that walks at the origin in the T-pose; `changes`: of its fields."""
    rotations = np.zeros((NEW_FRAMES, POSED_JOINTS, 4), np.float32)
    rotations[..., 3] = 1
    values = {
        "agent_id": "a",
        "alias": 1,
        "seq": seq,
        "first_frame": NEW_FRAMES * seq,
        "scheduled_at": STEP_SECONDS * seq,
        "goal_revision": 0,
        "flags": ChunkFlag.NONE,
        "state": AgentState.WALKING,
        "translation": np.zeros((NEW_FRAMES, 3), np.float32),
        "rotations": rotations,
        "contacts": np.zeros((NEW_FRAMES, 2), bool),
    }
    return MotionChunk(**values | changes)


class ManualClock:
    """Time that the test moves."""

    def __init__(self, now: float = 1000.0) -> None:
        self.now = now

    def __call__(self) -> float:
        return self.now


def populated(
    count: int = 1,
    engine: FakeEngine | None = None,
    spec: SessionSpec | None = None,
    **settings: object,
) -> tuple[World, list[str]]:
    """A world with `count` agents in session "s", and their ids."""
    world = make_world(engine, **settings)
    world.create_session(spec or SessionSpec("s"), 0.0)
    return world, [a.agent_id for a in world.create_agents("s", people(count), 0.0)]


def taken(world: World, session_id: str = "s") -> SessionRecord:
    """A session's record as of the last chunks sent, as in snapshots and the journal."""
    captured = capture_session(world, session_id)
    session, crowd = captured.part, captured.agents
    agents = (
        join_agent(member.part, crowd.rows.take(np.array([row])))
        for row, member in enumerate(crowd.members)
    )
    return SessionRecord(
        session.session_id, session.spec, session.created_at, session.last_alias, tuple(agents)
    )


def taken_agent(world: World, agent_id: str) -> AgentRecord:
    """The record of an agent of session "s", like `taken`."""
    return next(agent for agent in taken(world).agents if agent.agent_id == agent_id)
