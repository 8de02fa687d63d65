"""Sessions leave for other nodes of a cluster, and come from them.

For the node itself (cluster/), and not for callers: nothing here asks who calls.
"""

from wayfarer.endpoint import Endpoint
from wayfarer.errors import FailedPrecondition, NotFound, Unavailable, WayfarerError
from wayfarer.ids import slot_of
from wayfarer.transport.gateway.context import GatewayContext
from wayfarer.transport.residence import misdirected
from wayfarer.world.agents.agent import SessionInfo


class SessionMoves:
    """Of one server."""

    def __init__(self, context: GatewayContext) -> None:
        self._context = context

    @property
    def slots(self) -> set[int]:
        """In which a session or a scene is."""
        return {slot_of(name) for name in (*self.sessions, *self._context.scenes.ids())}

    def of(self, slot: int) -> list[str]:
        """Ids of the sessions in a slot, then of the scenes."""
        names = (*self.sessions, *self._context.scenes.ids())
        return [name for name in names if slot_of(name) == slot]

    @property
    def sessions(self) -> list[str]:
        """Ids of all."""
        return self._context.book.ids()

    def is_movable(self, session_id: str) -> bool:
        """Whether it is here, and can live elsewhere: it needs no scene, which is here only."""
        return self._context.book.scene_of(session_id) == ""

    # A copy

    async def replica(self, session_id: str) -> bytes:
        """Its state, as `adopt` takes it. Raises NotFound."""
        return await self._context.service.export_session(session_id)

    async def adopt(self, replica: bytes) -> str:
        """Let it live on from a copy; its id. Streams that come begin with a gap.

        Raises InvalidArgument, FailedPrecondition, AlreadyExists, ResourceExhausted.
        """
        info = await self._context.service.import_session(replica)
        await self._enter(info)
        return info.session_id

    # A move

    async def freeze(self, session_id: str) -> bytes:
        """Stop it after what is planned, and pack it; end that with `release` or `thaw`.

        Raises NotFound, FailedPrecondition, Unavailable.
        """
        if not self.is_movable(session_id):
            raise FailedPrecondition("it is in a scene, and scenes cannot be moved")
        moves = self._context.service.moves
        await moves.freeze(session_id)
        try:
            return await moves.export(session_id, {})
        except BaseException:
            await moves.unfreeze(session_id)
            raise

    async def thaw(self, session_id: str) -> None:
        """Let a frozen session go on here. Raises NotFound."""
        await self._context.service.moves.unfreeze(session_id)

    async def take(self, live: bytes) -> str:
        """Let a session that was frozen elsewhere go on here; its id.

        Raises InvalidArgument, FailedPrecondition, AlreadyExists, ResourceExhausted, Unavailable.
        """
        moves = self._context.service.moves
        info = await moves.import_(await moves.read(live))
        await self._enter(info)
        await moves.unfreeze(info.session_id)
        return info.session_id

    async def release(self, name: str, to: Endpoint | None) -> None:
        """A session or scene lives there now, or nobody knows where: end it here, and its streams.

        Its streams and the calls that wait end with Misdirected, or Unavailable. Safe to call
        twice.
        """
        error: WayfarerError = Unavailable("the session was taken from this node; try again")
        if to is not None:
            self._context.residence.left(name, to)
            error = misdirected(name, to)
        self._context.book.forget(name)
        self._context.scenes.forget(name)
        try:
            await self._context.service.moves.release(name, error)
        except NotFound:
            await self._end_other(name)

    async def _end_other(self, name: str) -> None:
        """One in lock-step, or a scene."""
        service = self._context.service
        end = service.scenes.delete_scene if name.startswith("scene-") else service.delete_session
        try:
            await end(name)
        except NotFound:
            return

    async def _enter(self, info: SessionInfo) -> None:
        agents = await self._context.service.list_agents(info.session_id)
        self._context.book.open(info, agents)
        self._context.residence.came(info.session_id)
