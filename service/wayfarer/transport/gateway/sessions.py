"""Sessions and their leases."""

import secrets

import structlog

from wayfarer.errors import InvalidArgument, Misdirected, NotFound, Unavailable
from wayfarer.ids import group_of, request_group, session_id
from wayfarer.transport import schema
from wayfarer.transport.conversion import convert
from wayfarer.transport.edge.caller import current_caller
from wayfarer.transport.gateway.context import GatewayContext, implements
from wayfarer.transport.gateway.idempotency import finish
from wayfarer.transport.gateway.leases import attributes
from wayfarer.transport.gateway.session_registry import LEASE_S, OpenSession
from wayfarer.world.agents.agent import SessionInfo, SessionSpec

log = structlog.get_logger(__name__)


class SessionApi:
    """SessionService."""

    def __init__(self, context: GatewayContext) -> None:
        self._context = context

    @implements("CreateSession")
    async def create(self, request: schema.NewSession) -> schema.Session:
        """Opens a session. Raises InvalidArgument, NotFound, Aborted, ResourceExhausted."""
        self._context.require_ready()
        return await self._context.replies.once(
            request.request_id,
            ("CreateSession", request),
            lambda digest: self._create(request, digest),
        )

    async def _create(self, request: schema.NewSession, digest: str) -> schema.Session:
        caller, name = current_caller(), ""
        if request.scene:
            self._context.scenes.scene(request.scene)
        if digest:
            alone = request_group(caller.name, request.request_id)
            name = session_id(group_of(request.scene) if request.scene else alone, digest)
            await self.end_expired()
            if self._context.sessions.scene_of(name) is not None:  # made before; the reply is lost
                return await self.get(name)
            self._context.locator.require_own(name)
        spec = SessionSpec(
            session_id=name or None,
            seed=secrets.randbits(32) if request.seed is None else request.seed,
            lock_step=request.lock_step,
            record=request.record,
            scene=request.scene,
            avoid=request.avoid,
            attributes=attributes(request, LEASE_S, self._context.limits),
        )
        with self._context.sessions.session_room(caller):
            info = await self._context.service.create_session(spec)
            made = self._context.sessions.open(info).describe(info)
        await self._context.locator.claimed(made.session_id)
        return made

    @implements("GetSession")
    async def get(self, session_id: str) -> schema.Session:
        """Describes a session. Raises NotFound."""
        session = self._context.sessions.session(session_id)
        return session.describe(await self._context.service.get_session(session_id))

    @implements("ListSessions")
    async def list_own(self) -> schema.Sessions:
        """The caller's sessions, oldest first; an admin sees all. Renews no lease."""
        infos = {info.session_id: info for info in await self._context.service.list_sessions()}
        owned = self._context.sessions.owned(current_caller())
        return schema.Sessions(
            sessions=tuple(
                session.describe(infos[session.session_id])
                for session in owned
                if session.session_id in infos
            )
        )

    @implements("RenewSession")
    async def renew(self, session_id: str) -> schema.Renewal:
        """Restarts the lease. Raises NotFound."""
        session = self._context.sessions.session(session_id)
        return schema.Renewal(expires_at_us=convert.microseconds(session.expires_at))

    @implements("DeleteSession")
    async def delete(self, session_id: str) -> None:
        """Ends a session, its agents and its streams. Raises NotFound, Unavailable."""
        await finish(self._end(self._context.sessions.session(session_id)))
        await self._context.locator.copied(session_id)

    async def end_expired(self) -> list[str]:
        """Ends the sessions whose lease has expired; returns the ids of ended ones.

        Sessions that cannot be ended now are tried again at the next call.
        """
        ended: list[str] = []
        for session in self._context.sessions.expired():
            try:
                await finish(self._end(session))
            except Unavailable:
                continue
            except (NotFound, Misdirected):  # its client, or a move, was quicker
                pass
            except Exception:  # the others must end in any case
                log.exception("session not ended; tried again", session_id=session.session_id)
                continue
            log.info("lease ended", session_id=session.session_id, lease_s=session.lease_s)
            ended.append(session.session_id)
        return ended

    async def take_over(self) -> int:
        """Enters the sessions that the runtime has kept over a restart; returns their number."""
        infos: list[SessionInfo] = await self._context.service.list_sessions()
        for info in infos:
            agents = await self._context.service.list_agents(info.session_id)
            try:
                self._context.locator.require_own(info.session_id)
                self._context.sessions.open(info, agents)
            except (InvalidArgument, Misdirected) as error:
                log.error("session not taken over", session_id=info.session_id, reason=str(error))
                await self._context.service.delete_session(info.session_id)
            except Exception:
                log.exception("session not taken over", session_id=info.session_id)
                await self._context.service.set_aside(info.session_id)
        self._context.taken_over = True
        return len(infos)

    async def _end(self, session: OpenSession) -> None:
        """Ends a session and then forgets it; if it were forgotten first, a failure would keep it
        forever.

        Raises NotFound, Unavailable.
        """
        try:
            await self._context.service.delete_session(session.session_id)
        except NotFound:
            self._context.sessions.close(session.session_id, session)
            raise
        self._context.sessions.close(session.session_id, session)
