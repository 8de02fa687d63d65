"""Streams, clips, lock-step. In JSON, poses are base64 of their bytes (docs/wire-format.md)."""

from typing import Annotated, Final

from pydantic import ConfigDict, Field

from wayfarer.body.skeleton import load_skeleton
from wayfarer.clips.edit import FASTEST
from wayfarer.clips.files import BodyDetail, BoneNames, FileFormat, FileUnit, RootMotion
from wayfarer.service.streams.publications import SlowReader
from wayfarer.spec import FPS
from wayfarer.transport.basis import Basis
from wayfarer.transport.codec import PoseEncoding, PoseProfile
from wayfarer.transport.codec.pose_format import RATES
from wayfarer.transport.schema.agents import AgentSpec
from wayfarer.transport.schema.base import (
    BasisInfo,
    Bool,
    Float,
    Length,
    Many,
    Message,
    OneOf,
    Problem,
    Uint32,
    Vector3,
    length_field,
)
from wayfarer.transport.schema.catalogue import Skeleton
from wayfarer.transport.schema.messages import Agent, Goal
from wayfarer.world.agents.agent import AgentState
from wayfarer.world.events import EventKind

BONES = tuple(bone.name for bone in load_skeleton())
BoneName = Annotated[str, Field(json_schema_extra={"enum": list(BONES)})]

MAX_RINGS: Final = 8
MAX_VIEWPOINTS: Final = 8
MIN_RADIUS: Final = 0.1
MAX_RADIUS: Final = 20_000.0
"""Metres."""

MIN_MESSAGE_BYTES: Final = 16_384
"""Room for a header, and for a chunk of an agent with its description."""

ID_LENGTH = 64
"""Most characters of a session's or agent's id."""


class PoseFormat(Message):
    """What poses hold and how they are packed."""

    encoding: PoseEncoding = PoseEncoding.F32_LE
    profile: PoseProfile = Field(
        default=PoseProfile.BODY, description="the 22 bones that move, all 52, or those of `bones`"
    )
    bones: Many[BoneName] = Field(
        default=(),
        max_length=len(BONES),
        description="only with profile `bones`: canonical names, each once",
        json_schema_extra={"uniqueItems": True},
    )
    fps: Uint32 = Field(
        default=0,
        description="frames per second; 0: 40",
        json_schema_extra={"enum": [0, *sorted(RATES)]},
    )


class Viewpoint(Message):
    """A place that agents are seen from."""

    position: Vector3 = Field(description="in the basis of the session")
    reach: Float = Field(
        default=0.0,
        description="the rings around it are this many times as wide: 0.01 to 100; 0: once",
    )


class Viewpoints(Message):
    """All viewpoints of a stream; they replace those before."""

    viewpoints: Many[Viewpoint] = Field(min_length=1, max_length=MAX_VIEWPOINTS)


class InterestRing(Message):
    """The agents within a distance of a viewpoint, and the detail in which they come."""

    radius: Length = length_field("distance to the hips", (MIN_RADIUS, MAX_RADIUS))
    format: PoseFormat | None = Field(
        default=None, description="how this tier is packed; absent: as the stream's `format`"
    )


class Interest(Message):
    """Levels of detail: an agent comes in the tier of the innermost ring that it is in."""

    rings: Many[InterestRing] = Field(
        min_length=1, max_length=MAX_RINGS, description="from the inside out: radii ascend"
    )
    viewpoints: Many[Viewpoint] = Field(
        min_length=1, max_length=MAX_VIEWPOINTS, description="the nearest counts"
    )


class StreamRequest(Message):
    """Asks for a stream."""

    session_id: str = Field(max_length=ID_LENGTH, description="the session to follow")
    agent_ids: tuple[str, ...] = Field(
        default=(), description="agents to follow; none: all, including later ones"
    )
    format: PoseFormat = PoseFormat()
    slow_reader: SlowReader = Field(
        default=SlowReader.DROP_OLDEST, description="what happens when the reader is too slow"
    )
    resume_token: str = Field(
        default="", description="last resume_token of an earlier stream, to continue after it"
    )
    interest: Interest | None = Field(
        default=None, description="detail by distance from viewpoints; none: all in `format`"
    )
    max_message_bytes: Uint32 = Field(
        default=0,
        description=f"most bytes of a message, {MIN_MESSAGE_BYTES} at least; 0: no bound",
    )


class MotionFile(Message):
    """A file of motion, in glTF's basis and metres unless its format says otherwise."""

    format: FileFormat = Field(
        default=FileFormat.GLB,
        description="glb and usd (UsdSkel) hold bodies, several people and a scene; "
        "vrma (any VRM), bvh and npz (layout of AMASS) one person",
    )
    names: BoneNames = Field(
        default=BoneNames.MIXAMO, description="names of the bones in glb, bvh and usd"
    )
    fps: Float | None = Field(
        default=None, ge=1, le=FASTEST, description="frames per second; default 40"
    )
    root: RootMotion = Field(
        default=RootMotion.HIPS,
        description="where the travelled path is: on the hips, on a bone `root` above, nowhere",
    )
    loop: Bool = Field(
        default=False, description="one cycle of steady walking out of it, whose ends meet"
    )
    unit: FileUnit = Field(default=FileUnit.METRES, description="of bvh")
    detail: BodyDetail = Field(default=BodyDetail.HIGH, description="mesh in glb and usd")


class MotionExport(Message):
    """Asks for the motion of a session as a file."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"seconds": 0.5}]})

    seconds: Float = Field(
        default=0.0,
        ge=0,
        description="to record from now on, at most limits.clip_s; 0: what a session made with "
        "`record` has recorded up to now",
    )
    file: MotionFile = MotionFile()


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

    agent: AgentSpec = Field(default=AgentSpec(), description="the agent that walks")
    goals: Many[Goal] = Field(
        default=(), max_length=1024, description="goals to visit in turn; none: the agent stands"
    )
    seconds: Float = Field(ge=1 / FPS, description="length in seconds; at most limits.clip_s")
    until_arrival: Bool = Field(
        default=False, description="end when the agent stands at the last goal"
    )
    basis: Basis = Field(default=Basis.GLTF, description="basis of the request and of the clip")
    format: PoseFormat = PoseFormat()
    file: MotionFile | None = Field(
        default=None, description="given: the answer is this file instead of JSON lines"
    )


class StepRequest(Message):
    """How far to advance a lock-step session."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"steps": 5}]})

    steps: Uint32 = Field(
        default=0, description="steps of 0.2 s; 0: one; at most limits.steps_per_call"
    )
    format: PoseFormat = PoseFormat()


class Tier(Message):
    """How the poses of a ring are packed."""

    radius: float
    pose_encoding: PoseEncoding
    sent_fps: int
    bones: tuple[int, ...]
    frame_bytes: int


class StreamHeader(Message):
    """What holds for the whole stream."""

    server_version: str
    session_id: str
    fps: int
    basis: BasisInfo
    skeleton: Skeleton
    pose_encoding: PoseEncoding
    sent_fps: int = Field(description="frames per second sent")
    bones: tuple[int, ...] = Field(
        description="indices into `skeleton.bones` of the rotations that are sent"
    )
    frame_bytes: int = Field(description="bytes of one frame in `poses`")
    resume_s: float = Field(description="seconds of motion kept for streams that resume")
    resumed: bool = Field(description="continues without a gap after the requested resume_token")
    tiers: tuple[Tier, ...] = Field(default=(), description="how the poses of each ring are packed")


class MotionChunks(Message):
    """Chunks, each with the new frames of one agent, as columns: the i-th values are chunk i."""

    aliases: tuple[int, ...]
    seqs: tuple[int, ...] = Field(description="sequence number: 0, 1, 2 … per agent")
    first_frames: tuple[int, ...] = Field(
        description="number of the first frame since the agent was created, at 40 per second"
    )
    scheduled_at_us: tuple[int, ...] = Field(
        description="display time of the first frame: microseconds since the Unix epoch"
    )
    goal_revisions: tuple[int, ...]
    states: tuple[AgentState, ...]
    flags: tuple[int, ...] = Field(description="sums of ChunkFlag values")
    poses: str = Field(description="base64 of the packed frames, chunk after chunk")
    contacts: str = Field(
        description="base64; one byte per frame, the sum of 1 (left foot) and 2 (right foot)"
    )
    waypoints: tuple[int, ...]
    candidates: tuple[int, ...]


class MotionBatch(Message):
    """Chunks that are due together, and agents that were added or removed."""

    added: tuple[Agent, ...] = Field(description="agents whose first chunk is in this batch")
    chunks: MotionChunks | None = Field(default=None, description="at most one chunk per agent")
    removed: tuple[int, ...] = Field(description="aliases of deleted agents")
    resume_token: str
    tier: int = Field(default=0, description="index into the header's `tiers`")
    hidden: tuple[int, ...] = Field(
        default=(), description="aliases of agents that have left the last ring"
    )


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
    """Motion and events of the steps."""

    batches: tuple[MotionBatch, ...] = Field(description="one per step")
    events: tuple[Event, ...]


class ClipLine(OneOf):
    """One line of a clip or replay: a header first, then batches; a problem if it broke off.

    It has one key.
    """

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    header: StreamHeader | None = None
    batch: MotionBatch | None = None
    problem: Problem | None = None
