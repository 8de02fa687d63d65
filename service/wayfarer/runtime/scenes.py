"""The scenes of a server, for event loops: slow work runs on worker threads.

Each rule for a call on a scene stands in one place: owner, basis and lease in
`transport/gateway/scene_access.py`; waiting for moves and for the disk here; limits, names, one
bake at a time, one change at a time and the sessions in a scene in
`world/scenes/scene_registry.py`.
"""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Concatenate, Final, ParamSpec, TypeVar

from wayfarer.errors import FailedPrecondition, Unreachable
from wayfarer.navigation.scene import Scene
from wayfarer.runtime.homes import Homes
from wayfarer.runtime.move_locks import MoveLocks
from wayfarer.runtime.persistence.persistence import Persistence
from wayfarer.world.scenes.messages import Crowd, CrowdState, SceneInfo, SceneSource
from wayfarer.world.scenes.populate import CrowdPeople
from wayfarer.world.scenes.scene_registry import MAX_BAKES, SceneRegistry

P = ParamSpec("P")
T = TypeVar("T")

POLLS: Final = 100
POLL_S: Final = 0.05
"""Seconds between checks of the people who come."""


class SceneService:
    """Scenes, and the people who live there.

    A session is in at most one scene, named when it is created (`SessionSpec.scene`). A change
    returns once the journal has it on disk. `registry` answers at once what needs no waiting.
    """

    def __init__(
        self,
        *,
        registry: SceneRegistry,
        persistence: Persistence,
        homes: Homes,
        clock: Callable[[], float],
        move_locks: MoveLocks,
    ) -> None:
        self.registry = registry
        self._move_locks = move_locks
        self._persistence = persistence
        self._homes = homes
        self._clock = clock
        # A bake holds one thread while it waits; the other threads are for quick calls.
        threads = MAX_BAKES + 2
        self._workers = ThreadPoolExecutor(threads, "scenes")

    def stop(self) -> None:
        """Drops calls that have not started."""
        self._workers.shutdown(wait=False, cancel_futures=True)

    async def create(self, source: SceneSource, scene_id: str = "") -> SceneInfo:
        """As the registry's method, durably."""
        made = await self.work(self.registry.create, source, self._clock(), scene_id)
        return await self._persistence.durable(made)

    async def change(
        self,
        method: Callable[Concatenate[SceneRegistry, str, P], T],
        scene_id: str,
        *args: P.args,
        **kwargs: P.kwargs,
    ) -> T:
        """Calls a method of the registry that changes or deletes a scene: durably, and not while it
        moves. Agents whose way becomes blocked plan again. Raises as the method does.
        """
        async with self._move_locks.through(scene_id):
            made = await self.work(method, self.registry, scene_id, *args, **kwargs)
        return await self._persistence.durable(made)

    async def look(
        self,
        method: Callable[Concatenate[Scene, P], T],
        scene_id: str,
        *args: P.args,
        **kwargs: P.kwargs,
    ) -> T:
        """Calls a function on the present version of a scene. Raises NotFound, and as it does."""
        scene = self.registry.entry(scene_id).scene
        try:
            return await self.work(method, scene, *args, **kwargs)
        except Unreachable as error:
            raise await self.work(error.explained) from None  # with the blocking obstacles

    async def work(self, call: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Calls a function on a worker thread."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._workers, lambda: call(*args, **kwargs))

    async def populate(self, session_id: str, crowd: Crowd) -> CrowdState:
        """Replaces an earlier crowd with people that come and go; returns how many have come.

        With `count` 0 the present people leave. People for whom there is no room wait for it.
        Raises NotFound, FailedPrecondition if the session is in no scene, InvalidArgument.
        """
        if self._homes.is_stepped(session_id):
            raise FailedPrecondition(
                f"session {session_id!r} is in lock-step: people come and go as time passes; "
                "create agents in it instead, and let them wander"
            )
        async with self._move_locks.through(session_id):
            await self._homes.live.ask(lambda world, now: world.crowds.set(session_id, crowd, now))
        for _ in range(POLLS):
            state = await self._homes.live.ask(lambda world, now: world.crowds.state(session_id))
            if state.is_settled:
                break
            await asyncio.sleep(POLL_S)
        return state

    async def crowd(self, session_id: str) -> CrowdPeople | None:
        """The session's present crowd; None: it has none."""
        return await self._homes.live.ask(lambda world, _: world.crowds.copy(session_id))
