"""Bodies with a trunk, and defined trajectories."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from tests.world.fakes import BODIES as STICKS
from tests.world.fakes import FakeEngine, start_poses
from wayfarer.body.library import load_body
from wayfarer.body.model import BodyModel
from wayfarer.models.bundle import ModelBundle
from wayfarer.spec import GENDERS, POSED_JOINTS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.steering import Steering, default_searches
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.world import World
from wayfarer_lab.evaluation.tasks import IssuedCommand, Trajectory

TRUNK = {"LFWT": (-0.1, 1.0), "LBWT": (-0.1, 1.0), "RFWT": (0.1, 1.0), "RBWT": (0.1, 1.0)}
CHEST = {"C7": (0.0, 1.4), "CLAV": (0.0, 1.4)}
"""Markers of the trunk: metres to the right, and up."""


def with_trunk(body: BodyModel) -> BodyModel:
    """A body of sticks whose first markers are those of a trunk, straight up."""
    names, vertices = list(body.marker_names), body.bind_vertices.copy()
    for row, (name, (right, up)) in enumerate((TRUNK | CHEST).items()):
        names[row], vertices[row] = name, (right, 0.0, up)
    return replace(body, marker_names=tuple(names), bind_vertices=vertices)


BODIES = {gender: with_trunk(body) for gender, body in STICKS.items()}
ANNY = {gender: load_body("anny52", gender, "low") for gender in GENDERS}


def gliding_bundle(bodies: dict[str, BodyModel], *files: str) -> ModelBundle:
    """Stands for a folder of models with `files`; its people glide."""
    return ModelBundle(SimpleNamespace(contracts=files), FakeEngine(), bodies)


ALIKE = Steering(
    reactions=1,
    searches={mode: replace(s, own=0.0) for mode, s in default_searches().items()},
)
"""Settings without hesitation and without agents' own noise."""


def make_world(engine: FakeEngine | None = None) -> World:
    """A world whose agents are alike and step at the same moments."""
    settings = WorldSettings(phases=1, steering=ALIKE)
    return World(engine or FakeEngine(), BODIES, start_poses(), settings)


def trajectory(
    places: np.ndarray,
    goals: Goal | Sequence[Goal],
    headings: float | np.ndarray = 0.0,
    frame: int = 0,
) -> Trajectory:
    """Hips at places [T, 2] with headings [T] (radians); `goals` were given at `frame`."""
    frames = len(places)
    half = np.broadcast_to(np.asarray(headings, float) / 2, frames)
    rotations = np.zeros((frames, POSED_JOINTS, 4))
    rotations[..., 3] = 1.0
    rotations[:, 0, 2], rotations[:, 0, 3] = np.sin(half), np.cos(half)
    path = (goals,) if isinstance(goals, Goal) else tuple(goals)
    return Trajectory(
        spec=AgentSpec(),
        given=(IssuedCommand(path, frame),),
        hips=np.concatenate([places, np.full((frames, 1), 0.9)], -1),
        rotations=rotations,
        contacts=np.ones((frames, 2), bool),
    )


def line(metres: np.ndarray, angle: float = 0.0) -> np.ndarray:
    """Places [T, 2] at `metres` along +Y, or `angle` radians to the left of it."""
    return np.asarray(metres)[:, None] * np.array([-np.sin(angle), np.cos(angle)])
