"""Streams, clips, lock-step. Poses stand in JSON as base64 of their bytes (docs/wire-format.md)."""

from typing import Annotated

from pydantic import ConfigDict, Field

from wayfarer.body.skeleton import load_skeleton
from wayfarer.service.streams.publications import SlowReader
from wayfarer.spec import FPS
from wayfarer.transport.basis import Basis
from wayfarer.transport.codec import PoseEncoding, PoseProfile
from wayfarer.transport.codec.pose_format import RATES
from wayfarer.transport.schema.agents import Agent, AgentSpec
from wayfarer.transport.schema.base import (
    BasisInfo,
    Bool,
    Float,
    Many,
    Message,
    OneOf,
    Problem,
    Uint32,
)
from wayfarer.transport.schema.catalogue import Skeleton
from wayfarer.transport.schema.goals import Goal
from wayfarer.world.agents.agent import AgentState
from wayfarer.world.events import EventKind

BONES = tuple(bone.name for bone in load_skeleton())
BoneName = Annotated[str, Field(json_schema_extra={"enum": list(BONES)})]

ID_LENGTH = 64
"""Characters of a session's or agent's id at most."""


class PoseFormat(Message):
    """What poses hold and how they are packed."""

    encoding: PoseEncoding = PoseEncoding.F32_LE
    profile: PoseProfile = Field(
        default=PoseProfile.BODY, description="the 22 bones that move, all 52, or those of `bones`"
    )
    bones: Many[BoneName] = Field(
        default=(),
        max_length=len(BONES),
        description="with profile `bones`, and only then: canonical names, each once",
        json_schema_extra={"uniqueItems": True},
    )
    fps: Uint32 = Field(
        default=0, description="0: 40", json_schema_extra={"enum": [0, *sorted(RATES)]}
    )


class StreamRequest(Message):
    """Asks for a stream."""

    session_id: str = Field(max_length=ID_LENGTH, description="the session to follow")
    agent_ids: tuple[str, ...] = Field(default=(), description="none: all, later ones too")
    format: PoseFormat = PoseFormat()
    slow_reader: SlowReader = Field(
        default=SlowReader.DROP_OLDEST, description="what to do when the reader is too slow"
    )
    resume_token: str = Field(default="", description="the last one of an earlier stream")


class ClipRequest(Message):
    """Asks for a clip."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "agent": {"gender": "male", "seed": 7},
                    "goals": [{"position": {"x": 0, "y": 0, "z": 4}}],
                    "seconds": 8,
                    "until_arrival": True,
                }
            ]
        }
    )

    agent: AgentSpec = Field(default=AgentSpec(), description="who walks")
    goals: Many[Goal] = Field(
        default=(), max_length=1024, description="to visit in turn; none: the agent stands"
    )
    seconds: Float = Field(ge=1 / FPS, description="length; at most limits.clip_s")
    until_arrival: Bool = Field(
        default=False, description="end once the agent stands at the last goal"
    )
    basis: Basis = Field(default=Basis.GLTF, description="basis of the request and of the clip")
    format: PoseFormat = PoseFormat()


class StepRequest(Message):
    """Asks that time pass in a lock-step session."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"steps": 5}]})

    steps: Uint32 = Field(
        default=0, description="primitives of 0.2 s; 0: one; at most limits.steps_per_call"
    )
    format: PoseFormat = PoseFormat()


class StreamHeader(Message):
    """What holds for all that follows."""

    server_version: str
    session_id: str
    fps: int
    basis: BasisInfo
    skeleton: Skeleton
    pose_encoding: PoseEncoding
    sent_fps: int = Field(description="frames per second that are sent")
    bones: tuple[int, ...] = Field(description="indices of the bones whose rotations are sent")
    frame_bytes: int = Field(description="bytes of one frame in `poses`")
    resume_s: float = Field(description="seconds of motion held for a stream that resumes")
    resumed: bool = Field(description="goes on without a gap where resume_token left off")


class MotionChunks(Message):
    """Chunks, each the new frames of one agent, as columns: one value of each chunk."""

    aliases: tuple[int, ...]
    seqs: tuple[int, ...] = Field(description="0, 1, 2 … per agent")
    first_frames: tuple[int, ...] = Field(description="since the agent was created")
    scheduled_at_us: tuple[int, ...] = Field(description="when to show the first frame")
    goal_revisions: tuple[int, ...]
    states: tuple[AgentState, ...]
    flags: tuple[int, ...] = Field(description="sums of ChunkFlag values")
    poses: str = Field(description="base64 of the packed frames, chunk after chunk")
    contacts: str = Field(description="base64; one byte per frame: 1 left foot, 2 right foot")
    waypoints: tuple[int, ...]
    candidates: tuple[int, ...]


class MotionBatch(Message):
    """Chunks that fell due together, and news of agents."""

    added: tuple[Agent, ...] = Field(description="agents whose first chunk is in this batch")
    chunks: MotionChunks | None = Field(default=None, description="one of an agent at most")
    removed: tuple[int, ...] = Field(description="aliases of deleted agents")
    resume_token: str


class Event(Message):
    """Something that happened to an agent, a stream or the server."""

    kind: EventKind
    agent_id: str = Field(description="empty for a stream or the server")
    alias: int
    at_us: int = Field(description="microseconds since the Unix epoch")
    goal_revision: int
    waypoint: int
    detail: str = Field(description="a sentence for people")


class Steps(Message):
    """What happened meanwhile."""

    batches: tuple[MotionBatch, ...] = Field(description="one for each primitive")
    events: tuple[Event, ...]


class ClipLine(OneOf):
    """One line of a clip or replay: a header first, then batches; a problem if it broke off.

    It has one key.
    """

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    header: StreamHeader | None = None
    batch: MotionBatch | None = None
    problem: Problem | None = None
