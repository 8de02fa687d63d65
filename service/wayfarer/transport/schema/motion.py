"""Streams, clips, lock-step. In JSON, poses are base64 of their bytes (docs/wire-format.md)."""

from typing import Annotated, Final

from pydantic import ConfigDict, Field

from wayfarer.body.skeleton import load_skeleton
from wayfarer.clips.edit import FASTEST
from wayfarer.clips.files import BodyDetail, BoneNames, FileFormat, FileUnit, RootMotion
from wayfarer.runtime.streams.publications import SlowReader
from wayfarer.spec import FPS
from wayfarer.transport.codec import PoseEncoding, PoseProfile
from wayfarer.transport.codec.pose_format import RATES
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.schema.agents import AgentSpec
from wayfarer.transport.schema.base import (
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
from wayfarer.transport.schema.messages import Goal, MotionBatch, StreamHeader

BONES = tuple(bone.name for bone in load_skeleton())
BoneName = Annotated[str, Field(json_schema_extra={"enum": list(BONES)})]

MAX_RINGS: Final = 8
MAX_VIEWPOINTS: Final = 8
MIN_RADIUS: Final = 0.1
MAX_RADIUS: Final = 20_000.0
"""Metres."""

MIN_MESSAGE_BYTES: Final = 16_384
"""Minimum size of a message: room for a header, and for an agent's chunk with its description."""

ID_LENGTH = 64
"""Maximum characters of a session's or agent's id."""


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


class ClipLine(OneOf):
    """One line of a clip or replay: a header first, then batches; a problem if it broke off.

    It has one key.
    """

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    header: StreamHeader | None = None
    batch: MotionBatch | None = None
    problem: Problem | None = None
