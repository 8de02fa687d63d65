"""The parts of the gateway that all APIs share."""

import asyncio
import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from wayfarer.config.limits import Limits
from wayfarer.errors import NotFound, Unavailable
from wayfarer.runtime.motion_service import MotionService
from wayfarer.transport import schema
from wayfarer.transport.codec import PoseEncoder, PoseFormat
from wayfarer.transport.contract import CALLS
from wayfarer.transport.conversion import convert
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.edge.caller import Scope, current_caller
from wayfarer.transport.gateway.idempotency import IdempotencyCache
from wayfarer.transport.gateway.scene_access import SceneAccess
from wayfarer.transport.gateway.session_locator import SessionLocator
from wayfarer.transport.gateway.session_registry import OpenSession, SessionRegistry
from wayfarer.transport.streams.batches import BatchWriter

Method = TypeVar("Method", bound=Callable[..., Any])


def needs(scope: Scope) -> Callable[[Method], Method]:
    """Lets only callers with the scope call a method of the API. Raises PermissionDenied."""

    def guarded(method: Method) -> Method:
        @functools.wraps(method)
        def checked(*args: Any, **kwargs: Any) -> Any:
            current_caller().require(scope)
            return method(*args, **kwargs)

        checked.scope = scope  # type: ignore[attr-defined]
        return checked  # type: ignore[return-value]

    return guarded


def implements(rpc: str) -> Callable[[Method], Method]:
    """Marks a method of the API as the implementation of an RPC; it needs the RPC's scope."""

    def named(method: Method) -> Method:
        guarded = needs(CALLS[rpc].scope)(method)
        guarded.rpc = rpc  # type: ignore[attr-defined]
        return guarded

    return named


@dataclass
class GatewayContext:
    """One per server. `clock` returns Unix seconds and is the runtime's own."""

    service: MotionService
    bodies: BodyLibrary
    limits: Limits
    clock: Callable[[], float]
    locator: SessionLocator = field(default_factory=SessionLocator)
    sessions: SessionRegistry = field(init=False)
    scenes: SceneAccess = field(init=False)
    replies: IdempotencyCache = field(init=False)
    encoder: PoseEncoder = field(default_factory=PoseEncoder)
    skeleton: schema.Skeleton = field(default_factory=convert.skeleton)
    draining: asyncio.Event = field(default_factory=asyncio.Event)
    taken_over: bool = (
        False  # whether the registries hold the sessions that the runtime kept over a restart
    )

    def __post_init__(self) -> None:
        self.sessions = SessionRegistry(self.limits, self.clock, self.locator)
        self.scenes = SceneAccess(self.limits, self.clock, self.locator)
        self.replies = IdempotencyCache(self.clock)

    @property
    def ready(self) -> bool:
        """Whether new work is accepted."""
        return (
            self.service.ready
            and self.service.alive
            and self.taken_over
            and not self.draining.is_set()
            and self.locator.holds
        )

    def require_ready(self) -> None:
        """Raises Unavailable while no new work is accepted."""
        if self.draining.is_set():
            raise Unavailable("the server is shutting down")
        if not self.ready:
            raise Unavailable("the server is not ready yet")

    async def session_of(self, agent_id: str) -> OpenSession:
        """Like the registry's method, also for people of a crowd, who come and go without a call
        and are not in the registry.
        """
        try:
            return self.sessions.session_of(agent_id)
        except NotFound as error:
            try:
                info = await self.service.get_agent(agent_id)
                return self.sessions.session(info.session_id)
            except NotFound:
                raise error from None

    def writer(self, basis: Basis, pose_format: PoseFormat) -> BatchWriter:
        """Writes motion for one reader; all writers share the packed poses."""
        return BatchWriter(basis, pose_format, self.encoder, self.bodies, self.skeleton)
