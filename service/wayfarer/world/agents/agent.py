"""Messages to and from the world: plain and frozen, in world space.

Transports convert their wire types to these and back, and nothing else crosses.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum, IntFlag, StrEnum
from typing import Annotated, Final, Self

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import NEW_FRAMES, POSED_JOINTS
from wayfarer.world.agents.goal import Goal
from wayfarer.world.rows import (
    Double,
    Flags,
    Float,
    Int,
    Int8,
    Int16,
    Object,
    Rows,
    Shape,
    UInt8,
)


@dataclass(frozen=True, slots=True)
class AgentSpec:
    """A digital human to create."""

    gender: str = "female"
    betas: tuple[float, ...] = (0.0,) * 10
    position: tuple[float, float] = (0.0, 0.0)  # metres, on the floor
    heading: float = 0.0  # radians about +Z; 0 faces +Y
    noise_seed: int = 0  # the agent's motion is reproducible from it
    name: str = ""  # shown by clients; need not be unique
    foot_lock: bool = True  # feet on the floor are kept from sliding
    floor: float = 0.0  # metres; in a scene of several storeys: the storey below this height
    model: str = ""  # name of the loaded motion model that moves it first; empty: the one in use
    outfit: str = ""  # name of its outfit; empty: its seed chooses


class AgentState(StrEnum):
    """The activity of an agent."""

    STANDING = "standing"
    WALKING = "walking"
    STOPPING = "stopping"
    TURNING = "turning"


STATES: Final = tuple(AgentState)
"""The states, in the order that `MotionChunks.state` counts them."""


class Sight(IntEnum):
    """How well an agent is seen by the reader that sees it best; see `transport/streams`."""

    NEAR = 0  # in the innermost ring; a stream without rings sees all agents like this
    FAR = 1
    ROOT = 2  # as a place and a heading
    NONE = 3


def by_sight(counts: Iterable[int]) -> dict[str, int]:
    """Counts in the order of `Sight`, by names: near, far, root, none."""
    return {sight.name.lower(): int(count) for sight, count in zip(Sight, counts, strict=True)}


class ChunkFlag(IntFlag):
    """Notes on a chunk; see docs/wire-format.md."""

    NONE = 0
    FIRST = 1  # start from it, do not blend: the agent's first chunk on this stream, or the pose
    # jumps because a step failed and the agent was reset to a stand
    REPLANNED = 2  # frames that were planned for this time were discarded for a new goal
    ARRIVED = 4  # the goal was reached during this chunk
    GAP = 8  # chunks before this one were dropped for this subscriber (it was too slow)
    REDUCED = 16  # fewer candidates than requested were tried, because time was short
    HELD = 32  # not stepped, because time was short and there was nothing to do: the pose is held


@dataclass(frozen=True, slots=True)
class AgentInfo:
    """A snapshot of one agent."""

    agent_id: str
    alias: int  # small number that stands for agent_id in chunks of this session
    session_id: str
    spec: AgentSpec
    state: AgentState
    position: tuple[float, float, float]  # hips, last sent frame
    heading: float
    goal: Goal | None  # the present one of its path
    goal_revision: int  # 0 before the first goal
    created_at: float  # Unix seconds
    waypoint: int = 0  # place of `goal` in its path, from 0; added goals continue the count
    waypoints: int = 0  # goals of its path so far, including passed ones
    model: str = ""  # the motion model that moves it


@dataclass(frozen=True, slots=True)
class MotionChunk:
    """The new frames of one agent from one step."""

    agent_id: str
    alias: int
    seq: int  # 0, 1, 2 … per agent
    first_frame: int  # index of its first frame since the agent began; 40 per second
    scheduled_at: float  # Unix seconds at which its first frame should be shown
    goal_revision: int
    flags: ChunkFlag
    state: AgentState
    translation: NDArray[np.float32] = field(repr=False)  # [F, 3]
    rotations: NDArray[np.float32] = field(repr=False)  # [F, 22, 4]
    contacts: NDArray[np.bool_] = field(repr=False)  # [F, 2] left, right
    waypoint: int = 0  # place in the path of the goal these frames were planned for
    candidates: int = 0  # number that was tried; with the seeds it reproduces the chunk


@dataclass(slots=True, eq=False)
class MotionChunks(Rows):
    """Chunks of several agents, each field of `MotionChunk` a column; all have as many frames.

    A sequence of `MotionChunk`, each made when it is requested.
    """

    agent_id: Object
    alias: Int
    seq: Int
    first_frame: Int
    scheduled_at: Double
    goal_revision: Int
    flags: UInt8
    state: Int8  # index into STATES
    translation: Annotated[Float, Shape(NEW_FRAMES, 3)]
    rotations: Annotated[Float, Shape(NEW_FRAMES, POSED_JOINTS, 4)]
    contacts: Annotated[Flags, Shape(NEW_FRAMES, 2)]
    waypoint: Int
    candidates: Int16

    @classmethod
    def of(cls, chunks: Sequence[MotionChunk]) -> Self:
        """Columns of chunks, at least one, of as many frames each."""
        return cls.join(
            [
                cls(
                    agent_id=np.array([chunk.agent_id], np.object_),
                    alias=np.array([chunk.alias]),
                    seq=np.array([chunk.seq]),
                    first_frame=np.array([chunk.first_frame]),
                    scheduled_at=np.array([chunk.scheduled_at]),
                    goal_revision=np.array([chunk.goal_revision]),
                    flags=np.array([chunk.flags], np.uint8),
                    state=np.array([STATES.index(chunk.state)], np.int8),
                    translation=chunk.translation[None],
                    rotations=chunk.rotations[None],
                    contacts=chunk.contacts[None],
                    waypoint=np.array([chunk.waypoint]),
                    candidates=np.array([chunk.candidates], np.int16),
                )
                for chunk in chunks
            ]
        )

    def __len__(self) -> int:
        return len(self.alias)

    def __getitem__(self, row: int) -> MotionChunk:
        return MotionChunk(
            agent_id=self.agent_id[row],
            alias=int(self.alias[row]),
            seq=int(self.seq[row]),
            first_frame=int(self.first_frame[row]),
            scheduled_at=float(self.scheduled_at[row]),
            goal_revision=int(self.goal_revision[row]),
            flags=ChunkFlag(int(self.flags[row])),
            state=STATES[self.state[row]],
            translation=self.translation[row],
            rotations=self.rotations[row],
            contacts=self.contacts[row],
            waypoint=int(self.waypoint[row]),
            candidates=int(self.candidates[row]),
        )

    def __iter__(self) -> Iterator[MotionChunk]:
        return map(self.__getitem__, range(len(self)))


NO_CHUNKS: Final = MotionChunks.empty(0)


@dataclass(frozen=True, slots=True)
class SessionSpec:
    """A session to open."""

    session_id: str | None = None  # chosen by the runtime when None
    seed: int = 0  # agents without a seed draw theirs from it
    lock_step: bool = False  # time passes only in `step_session`
    record: bool = False  # commands are kept for `export_log`
    scene: str = ""  # id of the scene that it is in; empty: an endless flat floor
    avoid: bool = True  # its agents avoid each other, unless it is recorded
    attributes: Mapping[str, str] = field(default_factory=dict)  # the transport's: kept, not read


@dataclass(frozen=True, slots=True)
class SessionInfo:
    """A client's set of agents."""

    session_id: str
    agent_ids: tuple[str, ...]
    created_at: float
    spec: SessionSpec = field(default_factory=SessionSpec)


@dataclass(frozen=True, slots=True)
class AgentChange:
    """The changes of an agent; None: no change."""

    name: str | None = None
    foot_lock: bool | None = None
