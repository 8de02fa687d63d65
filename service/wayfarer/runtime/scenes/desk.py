"""Scenes as event loops ask for them: everything that takes time is done on worker threads."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from wayfarer.navigation.spec import Obstacle, Point2, Point3
from wayfarer.runtime.scenes.book import Book
from wayfarer.runtime.scenes.messages import Outlines, SceneInfo, SceneWish, Way
from wayfarer.runtime.scenes.outlines import outlines

T = TypeVar("T")


class SceneDesk:
    """The part of `SceneService` that needs no world."""

    def __init__(self, book: Book, clock: Callable[[], float]) -> None:
        self._book = book
        self._clock = clock
        # Bakes hold a thread each while they wait; the others are for what is quick.
        threads = book.limits.bakes + book.limits.waiting + 2
        self._workers = ThreadPoolExecutor(threads, "scenes")

    def stop(self) -> None:
        """Give up what has not begun."""
        self._workers.shutdown(wait=False, cancel_futures=True)

    async def create_scene(self, wish: SceneWish) -> SceneInfo:
        """See `SceneService`, as for all below."""
        return await self._work(lambda: self._book.create(wish, self._clock()))

    async def get_scene(self, scene_id: str) -> SceneInfo:
        """See `SceneService`."""
        return self._book.info(scene_id)

    async def list_scenes(self) -> list[SceneInfo]:
        """See `SceneService`."""
        return self._book.infos()

    async def delete_scene(self, scene_id: str) -> None:
        """See `SceneService`."""
        self._book.delete(scene_id)

    async def put_obstacle(self, scene_id: str, name: str, obstacle: Obstacle) -> SceneInfo:
        """See `SceneService`."""
        return await self._work(lambda: self._book.put(scene_id, name, obstacle))

    async def remove_obstacle(self, scene_id: str, name: str) -> SceneInfo:
        """See `SceneService`."""
        return await self._work(lambda: self._book.remove(scene_id, name))

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
        # with a library for images, which comes when somebody wants one
        from wayfarer.navigation.picture import top_view

        scene = self._book.scene(scene_id)
        return await self._work(lambda: top_view(scene))

    async def _work(self, call: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._workers, call)
