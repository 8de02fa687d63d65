"""Requests and replies of the server, as plain values and numpy arrays.

All places, lengths and headings are in the session's basis; times are seconds of the server's
Unix clock.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntFlag
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from wayfarer_client.errors import InvalidArgument
from wayfarer_client.v1 import agent_pb2, common_pb2, goal_pb2, motion_pb2
from wayfarer_client.v1.fields import GoalFields

Float = NDArray[np.float32]
Place = tuple[float, float, float]


class Flag(IntFlag):
    """Notes on the frames of a chunk."""

    NONE = 0
    FIRST = 1  # first of this agent on this stream: start from it, do not blend
    REPLANNED = 2  # frames planned for this time were discarded for a new goal
    ARRIVED = 4  # the goal was reached
    GAP = 8  # earlier frames were lost, because this reader was too slow
    REDUCED = 16  # the server was short of time and tried fewer candidates than usual
    HELD = 32  # the server was short of time and the agent had nothing to do: it holds its pose


@dataclass(frozen=True, slots=True)
class PoseFormat:
    """Contents and packing of poses."""

    # or "smallest_three" (rotations within 0.009°); of streams "root"
    encoding: str = "f32_le"
    profile: str = "body"  # 22 bones; "full": 52, fingers at rest; "bones": those named
    bones: Sequence[str] = ()  # with "bones": names of the skeleton
    fps: int = 40  # or 20, 10: frames are left out

    def to_wire(self) -> motion_pb2.PoseFormat:
        """As protobuf."""
        if self.encoding == "root":
            return motion_pb2.PoseFormat(encoding=motion_pb2.POSE_ENCODING_ROOT)
        return motion_pb2.PoseFormat(
            encoding=enum_label(motion_pb2.PoseEncoding, self.encoding, "encoding"),
            profile=enum_label(motion_pb2.PoseProfile, self.profile, "profile"),
            bones=self.bones,
            fps=self.fps,
        )


@dataclass(frozen=True, slots=True)
class Ring:
    """The agents within a distance, and the detail in which they are sent."""

    radius: float  # from a viewpoint, in units of the basis: 0.1 m to 20 km
    format: PoseFormat | None = None  # None: as the stream's


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """A place that agents are seen from."""

    position: Place
    reach: float = 1.0  # the rings around it are this many times as wide: 0.01 to 100

    def to_wire(self) -> motion_pb2.Viewpoint:
        """As protobuf."""
        x, y, z = self.position
        return motion_pb2.Viewpoint(position=common_pb2.Vector3(x=x, y=y, z=z), reach=self.reach)


@dataclass(frozen=True, slots=True)
class Interest:
    """Levels of detail. An agent is sent in the detail of the innermost ring that contains it, and
    not at all outside of the last ring.
    """

    rings: Sequence[Ring]  # 1 to 8, from the inside out
    viewpoints: Sequence[Viewpoint]  # 1 to 8; the nearest counts

    def to_wire(self) -> motion_pb2.Interest:
        """As protobuf."""
        return motion_pb2.Interest(
            rings=[
                motion_pb2.InterestRing(
                    radius=ring.radius, format=ring.format.to_wire() if ring.format else None
                )
                for ring in self.rings
            ],
            viewpoints=[view.to_wire() for view in self.viewpoints],
        )


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
    model: str = ""  # loaded motion model that moves it; empty: the one in use
    outfit: str = ""  # e.g. "suit", "0" for none; empty: its seed chooses

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
            model=self.model,
            outfit=self.outfit,
        )
        if self.phenotype is not None:
            words = {name: getattr(self.phenotype, name) for name in Phenotype.__slots__}
            spec.phenotype.CopyFrom(agent_pb2.Phenotype(**words))
        return spec


@dataclass(frozen=True, slots=True)
class BodyFit:
    """A body with the proportions of a character."""

    body: str
    gender: str
    betas: tuple[float, ...]
    scale: float
    """Ratio of the character's size to the body's; 1 if a person can have such legs."""
    errors_cm: Mapping[str, float]
    """How much longer thigh, shin, foot … of the scaled body are than the character's."""

    def spec(self, **more: Any) -> AgentSpec:
        """An agent with this body; `more`: further fields of `AgentSpec`."""
        return AgentSpec(gender=self.gender, betas=self.betas, **more)


class Goal:
    """A place to walk to, and how, as in `Goal((2, 0, 3), speed=1.4)`: the fields of the message in
    goal.proto, in its order or by name (`GoalFields`). The server chooses for fields that are not
    given.
    """

    __slots__ = ("message",)

    def __init__(self, position: Place, *values: Any, **how: Unpack[GoalFields]) -> None:
        """`values`: radius, speed, heading … Raises TypeError for a field that there is not."""
        names = list(goal_pb2.Goal.DESCRIPTOR.fields_by_name)[1:]
        if unknown := [*(how.keys() - set(names)), *values[len(names) :]]:
            raise TypeError(
                f"a goal has no {unknown[0]}; beside its place it has {', '.join(names)}"
            )
        given: dict[str, Any] = {**dict(zip(names, values, strict=False)), **how}
        self.message = goal_pb2.Goal(position=vector(position), **given)

    @classmethod
    def from_wire(cls, message: goal_pb2.Goal) -> "Goal":
        """The goal of a protobuf message."""
        goal = cls((0.0, 0.0, 0.0))
        goal.message.CopyFrom(message)
        return goal

    @property
    def position(self) -> Place:
        """The place, in the session's basis."""
        place = self.message.position
        return place.x, place.y, place.z

    def __getattr__(self, name: str) -> Any:
        """The field of this name; None if it is not given."""
        if name not in goal_pb2.Goal.DESCRIPTOR.fields_by_name:
            raise AttributeError(f"a goal has no {name}", name=name, obj=self)
        return getattr(self.message, name) if self.message.HasField(name) else None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Goal) and self.message == other.message

    def __hash__(self) -> int:
        return hash(self.message.SerializeToString(deterministic=True))

    def __repr__(self) -> str:
        how = (f", {f.name}={v!r}" for f, v in self.message.ListFields() if f.name != "position")
        return f"Goal({self.position}{''.join(how)})"


@dataclass(frozen=True, slots=True)
class MotionFile:
    """A file of motion, in glTF's basis and metres unless its format says otherwise."""

    format: str = "glb"  # "usd" (UsdSkel): also several people; "vrma", "bvh", "npz" (AMASS): one
    names: str = "mixamo"  # of bones in glb, bvh, usd; or "unity", "vrm", "ue", "smpl"
    fps: float | None = None  # 1 to 240; None: 40
    root: str = "hips"  # where the travelled path is; "bone": on `root` above the hips; "in_place"
    loop: bool = False  # one cycle of steady walking, whose ends meet
    unit: str = "m"  # of bvh; or "cm"
    detail: str = "high"  # mesh in glb and usd; or "low"

    def to_wire(self) -> motion_pb2.MotionFile:
        """As protobuf. Raises InvalidArgument."""
        return motion_pb2.MotionFile(
            format=enum_label(motion_pb2.FileFormat, self.format, "format"),
            names=enum_label(motion_pb2.BoneNames, self.names, "names"),
            fps=self.fps,
            root=enum_label(motion_pb2.RootMotion, self.root, "root"),
            loop=self.loop,
            unit=enum_label(motion_pb2.FileUnit, self.unit, "unit"),
            detail=enum_label(motion_pb2.BodyDetail, self.detail, "detail"),
        )


@dataclass(frozen=True, slots=True)
class CrowdCame:
    """How many of the people that were asked for have come."""

    came: int  # present, or soon introduced by streams
    waiting: int  # they come when there is room
    reason: str  # why they have not yet; empty: they are on their way


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
    foot_lock: bool = True
    model: str = ""  # the motion model that moves it
    outfit: str = ""  # its clothes


@dataclass(frozen=True, slots=True)
class StreamInfo:
    """Properties of a whole stream, clip or replay."""

    server_version: str
    session_id: str
    encoding: str
    fps: int  # frames per second that are sent
    bones: tuple[str, ...]  # whose rotations are sent, in their order
    resume_s: float  # seconds of motion that the server keeps for a resumed stream
    resumed: bool  # it continues without a gap after a lost connection


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to an agent, the stream or the server."""

    kind: str  # "goal_reached", "path_done", "blocked" …: docs/wire-format.md; "" if unknown
    at: float  # of a goal: the scheduled time of its chunk
    agent: Agent | None  # None: the stream or the server
    goal_revision: int
    waypoint: int
    detail: str  # a sentence for people


@dataclass(frozen=True, slots=True)
class Frames:
    """The new frames of one agent: F of them, `StreamInfo.fps` per second."""

    agent: Agent  # as it was when the stream introduced it
    seq: int
    first_frame: int  # since the agent was created
    goal_revision: int
    state: str
    flags: Flag
    times: NDArray[np.float64] = field(repr=False)  # [F] when to show each
    translation: Float = field(repr=False)  # [F, 3] hips
    rotations: Float = field(repr=False)  # [F, B, 4] x, y, z, w; hips: world; else: local
    contacts: NDArray[np.bool_] = field(repr=False)  # [F, 2] left, right foot on the ground
    waypoint: int = 0  # place in its path of the goal they were planned for
    candidates: int = 0  # candidates that were tried for them


@dataclass(frozen=True, slots=True)
class Batch:
    """Frames that fell due together, or events."""

    sent_at: float
    frames: tuple[Frames, ...]
    added: tuple[Agent, ...] = ()  # agents seen for the first time
    removed: tuple[Agent, ...] = ()  # agents that were deleted
    events: tuple[Event, ...] = ()
    resume_token: str = ""  # says that all up to here has been received
    resumed_at: float | None = None  # server time of the last reconnection's header; None: none yet
    hidden: tuple[Agent, ...] = ()  # agents that have left the last ring
    tier: int = 0  # number of the ring that the agents of `frames` are in

    def __iter__(self) -> Iterator[Frames]:
        """Iterates over the frames."""
        return iter(self.frames)


def enum_label(enum: Any, name: str, field: str) -> str:
    """GENDER_MALE for "male" of enum Gender. Raises InvalidArgument that lists the names."""
    prefix = enum.keys()[0].removesuffix("UNSPECIFIED")
    known = [label.removeprefix(prefix).lower() for label in enum.keys()[1:]]
    if name not in known:
        raise InvalidArgument(f"{field}: {name!r} is none of {', '.join(known)}")
    return f"{prefix}{name.upper()}"


def vector(place: Sequence[float]) -> common_pb2.Vector3:
    """As protobuf. Raises InvalidArgument."""
    found = tuple(place)
    if len(found) != 3:
        raise InvalidArgument(
            f"{found} has {len(found)} numbers; a place has x, y and z, and which of them is up "
            "depends on the session's basis"
        )
    x, y, z = (float(value) for value in found)
    return common_pb2.Vector3(x=x, y=y, z=z)
