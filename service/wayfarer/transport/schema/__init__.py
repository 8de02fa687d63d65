"""The messages of the API as validated values: field for field those of `proto/wayfarer/v1`.

HTTP reads and writes them as JSON; gRPC converts them generically (wire.py). Ranges that need
no other knowledge are checked here, for both transports; the rest is checked in the gateway.
Lengths, places, headings are in the basis of the session unless a name ends in `_m`.
"""

from wayfarer.config import Limits
from wayfarer.transport.schema.agents import (
    Agent,
    Agents,
    AgentSpec,
    AgentUpdate,
    Gender,
    NewAgents,
    Phenotype,
)
from wayfarer.transport.schema.base import (
    BasisInfo,
    Endpoint,
    FieldProblem,
    Message,
    Problem,
    Vector3,
)
from wayfarer.transport.schema.catalogue import (
    Bodies,
    Body,
    Bone,
    Health,
    Model,
    Models,
    ModelUse,
    ModelUsed,
    NewModel,
    ServerInfo,
    Skeleton,
)
from wayfarer.transport.schema.goals import Area, Goal, GoalRevision, Goals, Wander
from wayfarer.transport.schema.motion import (
    ID_LENGTH,
    BoneName,
    ClipLine,
    ClipWish,
    Event,
    MotionBatch,
    MotionChunks,
    PoseFormat,
    Steps,
    StepWish,
    StreamHeader,
    StreamWish,
)
from wayfarer.transport.schema.sessions import NewSession, Renewal, Session, Sessions
from wayfarer.transport.schema.stats import Stats

__all__ = [
    "ID_LENGTH",
    "Agent",
    "AgentSpec",
    "AgentUpdate",
    "Agents",
    "Area",
    "BasisInfo",
    "Bodies",
    "Body",
    "Bone",
    "BoneName",
    "ClipLine",
    "ClipWish",
    "Endpoint",
    "Event",
    "FieldProblem",
    "Gender",
    "Goal",
    "GoalRevision",
    "Goals",
    "Health",
    "Limits",
    "Message",
    "Model",
    "ModelUse",
    "ModelUsed",
    "Models",
    "MotionBatch",
    "MotionChunks",
    "NewAgents",
    "NewModel",
    "NewSession",
    "Phenotype",
    "PoseFormat",
    "Problem",
    "Renewal",
    "ServerInfo",
    "Session",
    "Sessions",
    "Skeleton",
    "Stats",
    "StepWish",
    "Steps",
    "StreamHeader",
    "StreamWish",
    "Vector3",
    "Wander",
]
