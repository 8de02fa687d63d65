"""The API behind both transports: gRPC and HTTP only translate their own forms into its calls.

Arguments and results are classes of schema/, in the basis of the session. Every call is made by the
present caller (caller.py): its method checks the caller's scopes (`implements`), and
session_registry.py the ownership of sessions.
"""

import asyncio
import contextlib
from collections.abc import Callable, Sequence

import structlog

from wayfarer.config.limits import Limits
from wayfarer.endpoint import Endpoint
from wayfarer.errors import Unauthenticated, Unavailable
from wayfarer.ownership import Ownership
from wayfarer.runtime.motion_service import MotionService
from wayfarer.runtime.stats import LoopStats
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.edge.caller import Caller
from wayfarer.transport.gateway.admin import AdminApi
from wayfarer.transport.gateway.agents import AgentApi
from wayfarer.transport.gateway.catalogue import CatalogueApi
from wayfarer.transport.gateway.context import GatewayContext
from wayfarer.transport.gateway.goals import GoalApi
from wayfarer.transport.gateway.motion import MotionApi
from wayfarer.transport.gateway.moves import SessionMoves
from wayfarer.transport.gateway.scenes import SceneApi
from wayfarer.transport.gateway.session_locator import SessionLocator
from wayfarer.transport.gateway.sessions import SessionApi
from wayfarer.transport.gateway.snapshots import SnapshotApi
from wayfarer.transport.streams.stream import SHUTDOWN

log = structlog.get_logger(__name__)


class Gateway:
    """One per server. `clock` returns Unix seconds and is the runtime's own."""

    def __init__(
        self,
        service: MotionService,
        bodies: BodyLibrary,
        limits: Limits,
        clock: Callable[[], float],
        stop: Callable[[], None],
        ownership: Ownership | None = None,
    ) -> None:
        """`stop` begins the shutdown of the server, as SIGTERM does; AdminService calls it."""
        self._context = context = GatewayContext(
            service, bodies, limits, clock, SessionLocator(ownership)
        )
        self.limits = limits
        self.body_library = bodies
        self.scenes = SceneApi(context)
        self.sessions = SessionApi(context)
        self.agents = AgentApi(context)
        self.goals = GoalApi(context)
        self.motion = MotionApi(context)
        self.snapshots = SnapshotApi(context)
        self.catalogue = CatalogueApi(context)
        self.admin = AdminApi(context, stop)
        self.moves = SessionMoves(context)
        parts = (self.scenes, self.sessions, self.agents, self.goals, self.motion, self.snapshots)
        methods = [
            getattr(part, name)
            for part in (*parts, self.catalogue, self.admin)
            for name in vars(type(part))
        ]
        self.calls = {method.rpc: method for method in methods if hasattr(method, "rpc")}

    @property
    def alive(self) -> bool:
        """Whether the motion loop runs."""
        return self._context.service.alive

    @property
    def runtime_ready(self) -> bool:
        """Whether the runtime accepts work; the gateway does once it has its sessions."""
        return self._context.service.ready and self._context.service.alive

    @property
    def started(self) -> bool:
        """Whether the server has ever been ready."""
        return self._context.taken_over

    @property
    def ready(self) -> bool:
        """Whether new work is accepted."""
        return self._context.ready

    @property
    def streams(self) -> int:
        """Number of open streams."""
        return self._context.sessions.streams

    def nodes(self) -> Sequence[Endpoint]:
        """See `Ownership`."""
        return self._context.locator.nodes

    async def loop_stats(self) -> LoopStats:
        """Figures for the metrics page; checks no scope."""
        return await self._context.service.stats()

    async def take_over(self) -> None:
        """Enters the sessions that the ready runtime has kept, then accepts work."""
        await self.scenes.take_over()
        kept = await self.sessions.take_over()
        if kept:
            log.info("sessions taken over", sessions=kept)

    async def end_expired_sessions(self) -> list[str]:
        """Ends the sessions whose lease has expired, and such scenes; returns the sessions' ids.

        Should be called a few times per second.
        """
        ended = await self.sessions.end_expired()
        await self.scenes.end_expired()
        return ended

    def end_streams_of_revoked(self, is_good: Callable[[Caller], bool]) -> None:
        """Ends the streams of callers whose credentials are no longer valid. Called regularly."""
        revoked = Unauthenticated("the API key of this stream has been taken back")
        if ended := self._context.sessions.end_streams(revoked, lambda caller: not is_good(caller)):
            log.info("streams of revoked keys ended", streams=ended)

    async def drain(self, grace: float) -> None:
        """Refuses new work and ends all streams with Unavailable; waits up to `grace` seconds."""
        self._context.draining.set()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(grace):
                while self.streams:
                    self._context.sessions.end_streams(Unavailable(SHUTDOWN), of=lambda _: True)
                    await asyncio.sleep(0.01)
