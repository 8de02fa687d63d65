"""Sessions and scenes that move to other nodes of a cluster, or come from them.

The node itself (cluster/) calls this, and callers do not: no scope or owner is checked.
"""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

from wayfarer.endpoint import Endpoint
from wayfarer.errors import FailedPrecondition, NotFound, Unavailable, WayfarerError
from wayfarer.ids import group_of
from wayfarer.runtime.moving import LiveMoves, SceneMoves
from wayfarer.transport.gateway.context import GatewayContext
from wayfarer.transport.gateway.session_locator import misdirected
from wayfarer.world.agents.agent import AgentInfo, SessionInfo
from wayfarer.world.scenes.messages import SceneInfo

T = TypeVar("T")

FULL_S: Final = 30.0
"""Seconds for which a call is repeated while the motion thread has no room for it."""

AGAIN_S: Final = 0.05


def is_scene(name: str) -> bool:
    """Whether an id is a scene's rather than a session's."""
    return name.startswith("scene-")


@dataclass(frozen=True, slots=True)
class Arrival:
    """A session or scene that has arrived and that callers cannot find yet."""

    info: SessionInfo | SceneInfo
    agents: Sequence[AgentInfo] = ()  # without a crowd's people
    crowd: int = 0  # people who were requested


class SessionMoves:
    """The moves of one server."""

    def __init__(self, context: GatewayContext) -> None:
        self._context = context

    @property
    def groups(self) -> set[str]:
        """The groups of all sessions and scenes."""
        return {group_of(name) for name in (*self.sessions, *self.scenes)}

    def of(self, group: str) -> list[str]:
        """Ids of the sessions in a group, then of the scenes: the order in which they can end."""
        names = (*self.sessions, *self.scenes)
        return [name for name in names if group_of(name) == group]

    @property
    def sessions(self) -> list[str]:
        """Ids of all sessions."""
        return self._context.sessions.ids()

    @property
    def live(self) -> int:
        """Number of sessions that run in real time."""
        return self._context.sessions.live

    @property
    def scenes(self) -> list[str]:
        """Ids of all scenes."""
        return self._context.scenes.ids()

    def is_movable(self, name: str) -> bool:
        """Whether a session or scene is on this server and can move, as one group with its scene.

        All can, except sessions that were made before a session and its scene shared a group.
        """
        if is_scene(name):
            return name in self.scenes
        scene = self._context.sessions.scene_of(name)
        return scene is not None and (not scene or group_of(scene) == group_of(name))

    # The content of a scene: it is large and is sent ahead of the scene

    async def content(self, scene_id: str) -> bytes:
        """The parts of a scene that never change, baked. Raises NotFound."""
        return await self._context.service.scene_moves.content(scene_id)

    # Copies

    async def replica(self, name: str) -> bytes:
        """The state of a session or scene, as `take` takes an orphan's. Raises NotFound."""
        return await self._home(name).replica(name)

    # Moves

    async def freeze(self, name: str) -> bytes:
        """Stops it after the planned motion, and packs it; followed by `release` or `thaw`.

        Raises NotFound, FailedPrecondition, Unavailable.
        """
        if not self.is_movable(name):
            raise FailedPrecondition("its scene is in another group, and possibly on another node")
        moves = self._home(name)
        await moves.freeze(name)
        try:
            return await moves.export(name)
        except BaseException:
            await moves.unfreeze(name)
            raise

    async def thaw(self, name: str) -> None:
        """Resumes a frozen session or scene on this server. Raises NotFound, Unavailable."""
        await _served(lambda: self._home(name).unfreeze(name))

    async def take(self, name: str, data: bytes, content: bytes, orphan: bool = False) -> Arrival:
        """Installs a session or scene that another server froze, or, for an `orphan`, one that a
        server copied before it ended. It stays frozen. `content` is a scene's. No limit of sessions
        refuses an orphan.

        Followed by `enter` or `release`. Raises InvalidArgument, FailedPrecondition, AlreadyExists,
        ResourceExhausted, Unavailable.
        """
        if is_scene(name):
            info = await self._context.service.scene_moves.import_(name, content, data)
            return Arrival(info)
        moves = self._context.service.moves
        return await self._session(await moves.import_(await moves.read(data), orphan))

    async def enter(self, arrival: Arrival) -> None:
        """Resumes a taken session or scene on this server. Raises NotFound, Unavailable."""
        if isinstance(arrival.info, SessionInfo):
            await self.thaw(arrival.info.session_id)
        self._open(arrival)

    async def release(self, name: str, to: Endpoint | None) -> None:
        """Ends a session or scene on this server, since it now lives at `to`; None: unknown.

        Its streams and waiting calls end with Misdirected, or with Unavailable if `to` is None.
        Safe to call twice. Raises Unavailable.
        """
        error: WayfarerError = Unavailable("the session was taken from this node; try again")
        if to is not None:
            self._context.locator.left(name, to)
            error = misdirected(name, to)
        self._context.sessions.close(name)
        self._context.scenes.close(name)
        with contextlib.suppress(NotFound):
            await _served(lambda: self._home(name).release(name, error))

    def _home(self, name: str) -> LiveMoves | SceneMoves:
        return self._context.service.scene_moves if is_scene(name) else self._context.service.moves

    async def _session(self, info: SessionInfo) -> Arrival:
        service = self._context.service
        agents = await _served(lambda: service.list_agents(info.session_id))
        if not info.spec.scene:
            return Arrival(info, agents)
        crowd = await _served(lambda: service.scenes.crowd(info.session_id))
        if crowd is None:
            return Arrival(info, agents)
        created = [agent for agent in agents if agent.agent_id not in crowd.leaves_at]
        return Arrival(info, created, crowd.crowd.count)

    def _open(self, arrival: Arrival) -> None:
        info = arrival.info
        if isinstance(info, SessionInfo):
            self._context.sessions.open(info, arrival.agents).crowd = arrival.crowd
            self._context.locator.came(info.session_id)
        else:
            self._context.scenes.open(info)
            self._context.locator.came(info.scene_id)


async def _served(call: Callable[[], Awaitable[T]]) -> T:
    """Repeats a call that must succeed until the motion thread has room for it."""
    ends = asyncio.get_running_loop().time() + FULL_S
    while True:
        try:
            return await call()
        except Unavailable:
            if asyncio.get_running_loop().time() > ends:
                raise
            await asyncio.sleep(AGAIN_S)
