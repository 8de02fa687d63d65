"""The scenes of a server as event loops use them: slow calls run on worker threads."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Final, TypeVar

from wayfarer.errors import FailedPrecondition
from wayfarer.navigation.spec import Obstacle, Point2, Point3
from wayfarer.service.live import LiveMotion
from wayfarer.service.lockstep import LockSteps
from wayfarer.service.persistence.persistence import Persistence
from wayfarer.world.scenes.messages import (
    Crowd,
    CrowdState,
    Outlines,
    SceneInfo,
    SceneWish,
    Way,
)
from wayfarer.world.scenes.outlines import outlines
from wayfarer.world.scenes.scene_registry import MAX_BAKES, SceneRegistry

T = TypeVar("T")

LOOKS: Final = 100
LOOKS_EVERY: Final = 0.05
"""Seconds between looks at people who come."""


class Scenes:
    """Implements `SceneService`. A change returns once the journal has it on disk."""

    def __init__(
        self,
        *,
        book: SceneRegistry,
        persistence: Persistence,
        live: LiveMotion,
        lock_steps: LockSteps,
        clock: Callable[[], float],
    ) -> None:
        self._book = book
        self._persistence = persistence
        self._live = live
        self._lock_steps = lock_steps
        self._clock = clock
        # A bake holds one thread while it waits; the others are for what is quick.
        threads = MAX_BAKES + 2
        self._workers = ThreadPoolExecutor(threads, "scenes")

    def stop(self) -> None:
        """Give up calls that have not started."""
        self._workers.shutdown(wait=False, cancel_futures=True)

    async def create_scene(self, wish: SceneWish) -> SceneInfo:
        """See `SceneService`."""
        made = await self._work(lambda: self._book.create(wish, self._clock()))
        return await self._persistence.durable(made)

    async def get_scene(self, scene_id: str) -> SceneInfo:
        """See `SceneService`."""
        return self._book.info(scene_id)

    async def list_scenes(self) -> list[SceneInfo]:
        """See `SceneService`."""
        return self._book.infos()

    async def delete_scene(self, scene_id: str) -> None:
        """See `SceneService`."""
        self._book.delete(scene_id)
        await self._persistence.durable(None)

    async def put_obstacle(self, scene_id: str, name: str, obstacle: Obstacle) -> SceneInfo:
        """See `SceneService`."""
        made = await self._work(lambda: self._book.put(scene_id, name, obstacle))
        return await self._persistence.durable(made)

    async def remove_obstacle(self, scene_id: str, name: str) -> SceneInfo:
        """See `SceneService`."""
        made = await self._work(lambda: self._book.remove(scene_id, name))
        return await self._persistence.durable(made)

    async def query_path(self, scene_id: str, start: Point2 | Point3, goal: Point2 | Point3) -> Way:
        """See `SceneService`."""
        scene = self._book.scene(scene_id)
        path = await self._work(lambda: scene.path(start, goal))
        return Way(
            points=tuple((x, y, z) for x, y, z in path.points.tolist()),
            length=path.length,
            start_moved=path.start_moved,
            goal_moved=path.goal_moved,
            version=path.scene_version,
        )

    async def scene_outlines(self, scene_id: str) -> Outlines:
        """See `SceneService`."""
        scene = self._book.scene(scene_id)
        return await self._work(lambda: outlines(scene))

    async def scene_picture(self, scene_id: str) -> bytes:
        """See `SceneService`."""
        # the image library is loaded with the first picture
        from wayfarer.navigation.picture import top_view

        scene = self._book.scene(scene_id)
        return await self._work(lambda: top_view(scene))

    async def populate(self, session_id: str, crowd: Crowd) -> CrowdState:
        """See `SceneService`."""
        if self._lock_steps.session(session_id):
            raise FailedPrecondition(
                f"session {session_id!r} is in lock-step: people come and go as time passes; "
                "create agents in it instead, and let them wander"
            )
        await self._live.ask(lambda world, now: world.crowds.set(session_id, crowd, now))
        for _ in range(LOOKS):
            state = await self._live.ask(lambda world, now: world.crowds.state(session_id))
            if state.is_settled:
                break
            await asyncio.sleep(LOOKS_EVERY)
        return state

    async def _work(self, call: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._workers, call)
