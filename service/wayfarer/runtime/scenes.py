"""The scenes of a server as event loops use them: slow calls run on worker threads."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import FailedPrecondition, Unreachable, WayfarerError
from wayfarer.navigation.ground.ground import triangles
from wayfarer.navigation.scene_spec import Obstacle, Point2, Point3
from wayfarer.runtime.homes import Homes
from wayfarer.runtime.move_locks import MoveLocks
from wayfarer.runtime.persistence.persistence import Persistence
from wayfarer.runtime.persistence.scene_entries import (
    content_bytes,
    decode_scene,
    obstacles_bytes,
)
from wayfarer.world.scenes.messages import (
    Crowd,
    CrowdState,
    Outlines,
    SceneInfo,
    SceneSource,
    Way,
)
from wayfarer.world.scenes.outlines import outlines
from wayfarer.world.scenes.populate import CrowdPeople
from wayfarer.world.scenes.scene_registry import MAX_BAKES, SceneRegistry

T = TypeVar("T")

POLLS: Final = 100
POLL_S: Final = 0.05
"""Seconds between checks of the people who come."""


class SceneService:
    """Scenes, their obstacles, ways through them, and the people who live there.

    A session is in at most one scene, named when it is created (`SessionSpec.scene`). A change
    returns once the journal has it on disk.
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
        self._move_locks = move_locks
        self._registry = registry
        self._persistence = persistence
        self._homes = homes
        self._clock = clock
        # A bake holds one thread while it waits; the other threads are for quick calls.
        threads = MAX_BAKES + 2
        self._workers = ThreadPoolExecutor(threads, "scenes")

    def stop(self) -> None:
        """Drops calls that have not started."""
        self._workers.shutdown(wait=False, cancel_futures=True)

    async def create_scene(self, source: SceneSource, scene_id: str = "") -> SceneInfo:
        """Bakes it, off the motion thread; equal content is baked once. `scene_id`: empty for a
        new one.

        Raises InvalidArgument that names the field, AlreadyExists, ResourceExhausted if too
        many scenes are kept or being baked, or this one is too costly.
        """
        made = await self._work(lambda: self._registry.create(source, self._clock(), scene_id))
        return await self._persistence.durable(made)

    async def get_scene(self, scene_id: str) -> SceneInfo:
        """Raises NotFound."""
        return self._registry.info(scene_id)

    async def list_scenes(self) -> list[SceneInfo]:
        """All scenes, oldest first."""
        return self._registry.infos()

    async def delete_scene(self, scene_id: str) -> None:
        """Raises NotFound; FailedPrecondition while sessions are in it."""
        async with self._move_locks.through(scene_id):
            self._registry.delete(scene_id)
        await self._persistence.durable(None)

    async def put_obstacle(self, scene_id: str, name: str, obstacle: Obstacle) -> SceneInfo:
        """Adds an obstacle, or moves an existing one; agents whose way it blocks plan again.

        Raises NotFound, InvalidArgument, ResourceExhausted, and FailedPrecondition if no free
        ground would be left.
        """
        async with self._move_locks.through(scene_id):
            made = await self._work(lambda: self._registry.put(scene_id, name, obstacle))
        return await self._persistence.durable(made)

    async def remove_obstacle(self, scene_id: str, name: str) -> SceneInfo:
        """Raises NotFound."""
        async with self._move_locks.through(scene_id):
            made = await self._work(lambda: self._registry.remove(scene_id, name))
        return await self._persistence.durable(made)

    async def query_path(self, scene_id: str, start: Point2 | Point3, goal: Point2 | Point3) -> Way:
        """The way an agent would take. Raises NotFound, InvalidArgument, Unreachable."""
        scene = self._registry.scene(scene_id)
        try:
            path = await self._work(lambda: scene.path(start, goal))
        except Unreachable as error:
            raise await self.explained(error) from None
        return Way(
            points=tuple((x, y, z) for x, y, z in path.points.tolist()),
            length=path.length,
            start_moved=path.start_moved,
            goal_moved=path.goal_moved,
            version=path.scene_version,
        )

    async def explained(self, error: Unreachable) -> Unreachable:
        """The refusal with the blocking obstacles, which a worker thread looks for."""
        return await self._work(error.explained)

    async def scene_outlines(self, scene_id: str) -> Outlines:
        """Outlines for drawing it. Raises NotFound."""
        scene = self._registry.scene(scene_id)
        return await self._work(lambda: outlines(scene))

    async def scene_triangles(self, scene_id: str) -> NDArray[np.float64]:
        """All its triangles, with the present obstacles [T, 3, 3], metres. Raises NotFound."""
        scene = self._registry.scene(scene_id)
        spec = replace(scene.spec, solids=(*scene.spec.solids, *scene.obstacles.values()))
        return await self._work(lambda: triangles(spec))

    async def scene_picture(self, scene_id: str) -> bytes:
        """A top view, PNG. Raises NotFound."""
        # the image library is loaded with the first picture
        from wayfarer.navigation.picture import top_view

        scene = self._registry.scene(scene_id)
        return await self._work(lambda: top_view(scene))

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

    # Moves to another server: its content at any time, the rest with its sessions

    async def content(self, scene_id: str) -> bytes:
        """The parts of it that never change, baked, for `adopt`. Raises NotFound."""
        entry = self._registry.entry(scene_id)
        return await self._work(lambda: content_bytes(entry))

    def obstacles(self, scene_id: str) -> bytes:
        """The parts of it that change, for `adopt`. Raises NotFound."""
        return obstacles_bytes(self._registry.entry(scene_id))

    async def adopt(self, scene_id: str, content: bytes, obstacles: bytes) -> SceneInfo:
        """Adopts a scene from another server. Nothing is baked again.

        Raises InvalidArgument, AlreadyExists, ResourceExhausted.
        """
        record = await self._work(lambda: decode_scene(scene_id, content, obstacles))
        source, at, version, baked = record.source, record.created_at, record.version, record.baked
        await self._work(
            lambda: self._registry.restore(
                scene_id, source, at, version, record.obstacles, reported=False, baked=baked
            )
        )
        return await self._persistence.durable(self._registry.info(scene_id))

    async def freeze(self, scene_id: str) -> None:
        """Makes calls wait that change it or make sessions in it, until `unfreeze` or `release`.

        Raises Unavailable if calls in progress do not end.
        """
        await self._move_locks.close(scene_id)

    def unfreeze(self, scene_id: str) -> None:
        """Resumes it on this server."""
        self._move_locks.open(scene_id)

    async def release(self, scene_id: str, error: WayfarerError) -> None:
        """Ends it on this server, since it and its sessions live on another; waiting calls end with
        `error`.

        Raises NotFound, FailedPrecondition if sessions are in it.
        """
        try:
            self._registry.delete(scene_id)
        finally:
            self._move_locks.open(scene_id, error)
        await self._persistence.durable(None)

    async def _work(self, call: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._workers, call)
