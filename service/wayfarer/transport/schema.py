"""The messages of the API as validated values: field for field those of `proto/wayfarer/v1`.

HTTP reads and writes them as JSON; gRPC converts them generically (convert.py). Ranges that need
no other knowledge are checked here, for both transports; the rest is checked in gateway.py.
Lengths, places, headings are in the basis of the session unless a name ends in `_m`.
"""

from enum import StrEnum
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from wayfarer.config import Limits
from wayfarer.runtime.agent import AgentState
from wayfarer.spec import BETAS, JOINTS
from wayfarer.transport.basis import Basis

Beta = Annotated[float, Field(ge=-5, le=5)]


class Message(BaseModel):
    """Base of all: frozen, finite numbers only, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Gender(StrEnum):
    """Which of the shipped bodies an agent has."""

    FEMALE = "female"
    MALE = "male"


class Vector3(Message):
    """A point or direction in the basis of the session."""

    x: float
    y: float
    z: float


class BasisInfo(Message):
    """What a basis means."""

    basis: Basis
    metres_per_unit: float = Field(description="length of one unit: 1 or 0.01")
    right_handed: bool
    up: Vector3 = Field(description="unit vector that points up")
    forward: Vector3 = Field(description="unit vector that a body faces at heading 0")
    quaternion_order: str = "xyzw"


class NewSession(Message):
    """Asks for a session."""

    basis: Basis = Field(default=Basis.GLTF, description="basis of all it sends and receives")


class Session(Message):
    """A client's set of agents."""

    session_id: str
    basis: BasisInfo
    agent_ids: tuple[str, ...] = Field(description="in order of creation")
    created_at_us: int = Field(description="microseconds since the Unix epoch")


class Phenotype(Message):
    """A body in everyday words; what is absent takes the mean. The body checks the ranges."""

    height_m: float | None = Field(default=None, description="barefoot; range: see /v1/bodies")
    weight: float | None = Field(default=None, description="thin (0) to heavy (1)")
    muscle: float | None = Field(default=None, description="slack (0) to athletic (1)")
    age: float | None = Field(default=None, description="years, 20 to 80")


class AgentSpec(Message):
    """An agent to create. The body comes from `betas` or `phenotype`, not both."""

    gender: Gender = Gender.FEMALE
    betas: tuple[Beta, ...] = Field(
        default=(),
        max_length=BETAS,
        description=f"{BETAS} shape coefficients, or none for the mean body",
    )
    phenotype: Phenotype | None = None
    position: Vector3 | None = Field(
        default=None, description="start, on the floor; the origin if absent"
    )
    heading: float = Field(
        default=0.0, ge=-100, le=100, description="radians about up; 0 faces the basis's forward"
    )
    seed: int | None = Field(
        default=None,
        ge=0,
        lt=1 << 32,
        description="the motion is reproducible from it; server's choice",
    )
    name: str = Field(default="", max_length=64, pattern=r"^[^\x00-\x1f\x7f]*$")
    foot_lock: bool = Field(
        default=True,
        description="keep feet on the floor from sliding; false: poses as the model makes them",
    )

    @model_validator(mode="after")
    def _one_body(self) -> "AgentSpec":
        if self.betas and self.phenotype is not None:
            raise ValueError("give betas or phenotype, not both")
        if self.betas and len(self.betas) != BETAS:
            raise ValueError(f"betas must be {BETAS} numbers or none, not {len(self.betas)}")
        return self


class NewAgents(Message):
    """Asks for agents, all or none."""

    agents: tuple[AgentSpec, ...] = Field(min_length=1, max_length=1024)


class Goal(Message):
    """A place to walk to, and how."""

    position: Vector3 = Field(description="the component along up is ignored")
    radius: float | None = Field(
        default=None, description="arrived when this near; 0.05 to 10 m; 0.3 m"
    )
    speed: float | None = Field(default=None, description="on the way; 0.2 to 4 m/s; 1.2 m/s")
    heading: float | None = Field(
        default=None,
        ge=-100,
        le=100,
        description="to face once stopped there: radians about up, 0 faces the basis's forward",
    )
    stop: bool | None = Field(
        default=None, description="false: pass through without slowing, stop after the last; true"
    )
    strafe: bool | None = Field(
        default=None, description="face `heading` on the way, too: walk sideways, backwards; false"
    )
    dwell: float | None = Field(
        default=None, description="seconds to stand there before the next goal; 0 to 3600; 0"
    )


class Path(Message):
    """Goals to visit in turn."""

    goals: tuple[Goal, ...] = Field(min_length=1, max_length=1024)


class GoalRevision(Message):
    """The goal or the path was taken, or taken away."""

    revision: int


class Agent(Message):
    """A snapshot of one agent."""

    agent_id: str
    alias: int = Field(description="stands for agent_id in the chunks of this session")
    session_id: str
    name: str
    body: str = Field(description="name of its body model")
    gender: Gender
    betas: tuple[float, ...]
    seed: int
    state: AgentState
    position: Vector3 = Field(description="hips, last sent frame")
    heading: float
    goal: Goal | None
    goal_revision: int = Field(description="of the goal or path; 0 before the first")
    created_at_us: int
    rest_offsets: tuple[float, ...] = Field(
        description=f"{JOINTS} × 3 numbers: each joint relative to its parent's in the T-pose"
    )
    waypoint: int = Field(default=0, description="place of `goal` in its path, from 0")
    waypoints: int = Field(default=0, description="goals of its path")


class Agents(Message):
    """Agents in order of creation."""

    agents: tuple[Agent, ...]


class Bone(Message):
    """One bone, with its name in common engines (empty: it has no such bone)."""

    name: str
    parent: int = Field(description="index in `bones`; -1 for the root")
    mixamo: str = ""
    unity: str = ""
    vrm: str = ""
    ue: str = ""


class Skeleton(Message):
    """The bones of an agent; parents come before children."""

    bones: tuple[Bone, ...]
    posed_bones: int = Field(description="so many, from the first, have a rotation in every frame")


class Body(Message):
    """A body that agents can have."""

    name: str
    gender: Gender
    betas: int
    vertices: int
    faces: int
    min_height_m: float
    max_height_m: float
    glb_path: str


class Bodies(Message):
    """The bodies that agents can have."""

    bodies: tuple[Body, ...]


class Model(Message):
    """A loaded motion model."""

    name: str
    genders: tuple[Gender, ...]
    seed_frames: int
    primitive_frames: int
    sha256: tuple[str, ...] = Field(description="of each graph, in the order of `genders`")


class Models(Message):
    """The motion models that are loaded."""

    models: tuple[Model, ...]


class ServerInfo(Message):
    """What the server is."""

    version: str
    fps: int
    frames_per_chunk: int
    limits: Limits
    bases: tuple[BasisInfo, ...]


class Stats(Message):
    """Health of the motion loop over the last few seconds."""

    agents: int
    sessions: int
    subscribers: int
    steps: int = Field(description="agent steps since start")
    step_ms_mean: float = Field(description="one engine call")
    step_ms_p95: float
    late_chunks: int = Field(description="ready after their scheduled time, since start")
    lateness_ms_p95: float
    uptime_s: float
    resets: int = Field(description="agents put back to a stand after a broken step, since start")
    failures: int = Field(description="turns of the loop that raised, since start")
    rebased: int = Field(description="how often the schedule was moved, being > 1 s behind")
    dropped_batches: int = Field(description="lost by the present streams, being too slow")
    reduced_steps: int = Field(
        description="agent steps with fewer candidates than usual for want of time, since start"
    )


class Health(Message):
    """The answer to a probe."""

    status: str


class Problem(Message):
    """RFC 9457 problem document."""

    type: str
    title: str
    status: int
    detail: str
    errors: tuple[dict[str, str], ...] = Field(default=(), description="field and detail of each")
    retry_after_s: float | None = None
