"""What goes to the server and what comes back, as plain values and numpy arrays.

All places, lengths and headings are in the session's basis; times are seconds of the server's
Unix clock.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntFlag
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer_client.errors import InvalidArgument
from wayfarer_client.v1 import agent_pb2, common_pb2, goal_pb2, motion_pb2

Float = NDArray[np.float32]
Place = tuple[float, float, float]


class Flag(IntFlag):
    """Notes on the frames of a chunk."""

    NONE = 0
    FIRST = 1  # first of this agent on this stream: start from it, do not blend
    REPLANNED = 2  # frames planned for this time were thrown away for a new goal
    ARRIVED = 4  # the goal was reached
    GAP = 8  # earlier frames were lost, because this reader was too slow
    REDUCED = 16  # the server was short of time and tried fewer candidates than usual


@dataclass(frozen=True, slots=True)
class Phenotype:
    """A body in everyday words; None takes the mean."""

    height_m: float | None = None  # metres, barefoot
    weight: float | None = None  # 0 thin … 1 heavy
    muscle: float | None = None  # 0 slack … 1 athletic
    age: float | None = None  # years, 20 … 80


@dataclass(frozen=True, slots=True)
class AgentSpec:
    """An agent to create. The body comes from `betas` or `phenotype`, not both."""

    gender: str = "female"  # or "male"
    betas: Sequence[float] = ()  # 10 shape coefficients, or none for the mean body
    phenotype: Phenotype | None = None
    position: Place = (0.0, 0.0, 0.0)
    heading: float = 0.0  # radians about up; 0 faces the basis's forward
    seed: int | None = None  # None: the server chooses, and reports it
    name: str = ""
    foot_lock: bool = True  # keep feet on the floor from sliding; False: as the model makes them

    def to_wire(self) -> agent_pb2.AgentSpec:
        """As protobuf."""
        spec = agent_pb2.AgentSpec(
            gender=enum_label(agent_pb2.Gender, self.gender, "gender"),
            betas=self.betas,
            position=vector(self.position),
            heading=self.heading,
            seed=self.seed,
            name=self.name,
            foot_lock=self.foot_lock,
        )
        if self.phenotype is not None:
            words = {name: getattr(self.phenotype, name) for name in Phenotype.__slots__}
            spec.phenotype.CopyFrom(agent_pb2.Phenotype(**words))
        return spec


@dataclass(frozen=True, slots=True)
class Goal:
    """A place to walk to, and how."""

    position: Place
    radius: float | None = None  # arrived when this near; None: 0.3 m
    speed: float | None = None  # per second; None: 1.2 m/s
    heading: float | None = None  # radians about up, to face once stopped there; None: any
    stop: bool = True  # False: pass through without slowing; where no goal follows, stop after it
    strafe: bool = False  # face `heading` on the way, too: walk sideways or backwards
    dwell: float = 0.0  # seconds to stand there before the next goal of a path

    def to_wire(self) -> goal_pb2.Goal:
        """As protobuf."""
        given = {name: getattr(self, name) for name in Goal.__slots__ if name != "position"}
        return goal_pb2.Goal(position=vector(self.position), **given)


@dataclass(frozen=True, slots=True)
class Agent:
    """A snapshot of one agent."""

    agent_id: str
    alias: int
    session_id: str
    name: str
    body: str
    gender: str
    betas: tuple[float, ...]
    seed: int
    state: str  # "standing", "walking", "stopping", "turning"
    position: Place  # hips
    heading: float
    goal: Goal | None  # the present one of its path
    goal_revision: int
    created_at: float
    rest_offsets: Float = field(repr=False, compare=False)  # [J, 3] joint relative to parent
    waypoint: int = 0  # place of `goal` in its path
    waypoints: int = 0  # goals of its path


@dataclass(frozen=True, slots=True)
class Frames:
    """The new frames of one agent: F of them, 40 per second."""

    agent: Agent  # as it was when the stream introduced it
    seq: int
    first_frame: int  # since the agent was created
    goal_revision: int
    state: str
    flags: Flag
    times: NDArray[np.float64] = field(repr=False)  # [F] when each is to be shown
    translation: Float = field(repr=False)  # [F, 3] hips
    rotations: Float = field(repr=False)  # [F, 22, 4] x, y, z, w; hips: world; else: local
    contacts: NDArray[np.bool_] = field(repr=False)  # [F, 2] left, right foot on the ground
    waypoint: int = 0  # place in its path of the goal they were planned for
    candidates: int = 0  # so many were tried for them


@dataclass(frozen=True, slots=True)
class Batch:
    """What fell due together."""

    sent_at: float
    frames: tuple[Frames, ...]
    added: tuple[Agent, ...] = ()  # agents seen for the first time
    removed: tuple[Agent, ...] = ()  # agents that were deleted

    def __iter__(self) -> Iterator[Frames]:
        """Iterate over the frames."""
        return iter(self.frames)


STATES: Final = {
    number: name.removeprefix("AGENT_STATE_").lower()
    for name, number in agent_pb2.AgentState.items()
}
GENDERS: Final = {
    number: name.removeprefix("GENDER_").lower() for name, number in agent_pb2.Gender.items()
}


def enum_label(enum: Any, name: str, field: str) -> str:
    """GENDER_MALE for "male" of enum Gender. Raises InvalidArgument that lists the names."""
    prefix = enum.keys()[0].removesuffix("UNSPECIFIED")
    known = [label.removeprefix(prefix).lower() for label in enum.keys()[1:]]
    if name not in known:
        raise InvalidArgument(f"{field}: {name!r} is none of {', '.join(known)}")
    return f"{prefix}{name.upper()}"


def vector(place: Sequence[float]) -> common_pb2.Vector3:
    """As protobuf."""
    x, y, z = (float(value) for value in place)
    return common_pb2.Vector3(x=x, y=y, z=z)


def agent_from_wire(message: agent_pb2.Agent) -> Agent:
    """From protobuf."""
    goal = message.goal
    return Agent(
        agent_id=message.agent_id,
        alias=message.alias,
        session_id=message.session_id,
        name=message.name,
        body=message.body,
        gender=GENDERS[message.gender],
        betas=tuple(message.betas),
        seed=message.seed,
        state=STATES[message.state],
        position=_place(message.position),
        heading=message.heading,
        goal=_goal(goal) if message.HasField("goal") else None,
        goal_revision=message.goal_revision,
        created_at=message.created_at_us / 1e6,
        rest_offsets=np.array(message.rest_offsets, np.float32).reshape(-1, 3),
        waypoint=message.waypoint,
        waypoints=message.waypoints,
    )


def frames_from_wire(
    chunk: motion_pb2.MotionChunk, agents: Mapping[int, Agent], fps: int, posed_bones: int
) -> Frames:
    """Unpack POSE_ENCODING_F32_LE; see docs/wire-format.md."""
    packed = np.frombuffer(chunk.poses, "<f4").reshape(-1, 3 + 4 * posed_bones)
    contacts = np.frombuffer(chunk.contacts, np.uint8)
    return Frames(
        agent=agents[chunk.alias],
        seq=chunk.seq,
        first_frame=chunk.first_frame,
        goal_revision=chunk.goal_revision,
        state=STATES[chunk.state],
        flags=Flag(chunk.flags),
        times=chunk.scheduled_at_us / 1e6 + np.arange(len(packed)) / fps,
        translation=packed[:, :3],
        rotations=packed[:, 3:].reshape(-1, posed_bones, 4),
        contacts=(contacts[:, None] & np.array([1, 2])).astype(bool),
        waypoint=chunk.waypoint,
        candidates=chunk.candidates,
    )


def _goal(message: goal_pb2.Goal) -> Goal:
    return Goal(
        position=_place(message.position),
        radius=message.radius,
        speed=message.speed,
        heading=message.heading if message.HasField("heading") else None,
        stop=message.stop if message.HasField("stop") else True,
        strafe=message.strafe,
        dwell=message.dwell,
    )


def _place(message: common_pb2.Vector3) -> Place:
    return message.x, message.y, message.z
