"""Sessions."""

from pydantic import ConfigDict, Field

from wayfarer.transport.basis import Basis
from wayfarer.transport.schema.base import BasisInfo, Bool, Endpoint, Float, Message, Text, Uint32


class NewSession(Message):
    """A session to create. Every field has a default, so `{}` is enough."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"basis": "gltf", "seed": 7, "lease_s": 120}]}
    )

    basis: Basis = Field(
        default=Basis.GLTF, description="coordinate basis of everything it sends and receives"
    )
    seed: Uint32 | None = Field(
        default=None,
        description="agents without a seed draw theirs from it; chosen by the server if absent",
    )
    lease_s: Float | None = Field(
        default=None,
        ge=1,
        description="seconds it outlives its last call and stream: 1 to limits.lease_s; default 60",
    )
    scene: Text = Field(
        default="", description="id of a scene (createScene); empty: the endless flat floor"
    )
    lock_step: Bool = Field(default=False, description="time advances only by steps; no streams")
    record: Bool = Field(default=False, description="record its commands for its log")
    request_id: Text = Field(
        default="",
        description="for ten minutes, the same request with this id does nothing and gets the same "
        "reply, so that it can be retried; as the header Idempotency-Key",
    )
    avoid: Bool = Field(
        default=True, description="its agents avoid each other, unless it is recorded"
    )


class Session(Message):
    """A client's set of agents."""

    session_id: str
    basis: BasisInfo
    agent_ids: tuple[str, ...] = Field(description="in order of creation")
    created_at_us: int = Field(description="microseconds since the Unix epoch")
    seed: int = Field(description="agents without a seed draw theirs from it")
    lease_s: float = Field(description="seconds it outlives its last call and stream")
    expires_at_us: int = Field(
        description="when the lease ends unless renewed; an open stream renews it"
    )
    lock_step: bool
    record: bool
    scene: str = Field(description="id of its scene; empty: the endless flat floor")
    endpoint: Endpoint | None = Field(
        default=None, description="the node that holds it; null on a server of one process"
    )
    avoid: bool = Field(description="its agents avoid each other, unless it is recorded")


class Sessions(Message):
    """The caller's sessions."""

    sessions: tuple[Session, ...] = Field(description="oldest first")


class Renewal(Message):
    """The lease was renewed."""

    expires_at_us: int = Field(
        description="when the lease ends now: microseconds since the Unix epoch"
    )
