"""What the runtime does with scenes: made at a desk of their own, kept in the journal."""

from wayfarer.errors import FailedPrecondition
from wayfarer.navigation.spec import Obstacle, Point2, Point3
from wayfarer.runtime.loop import MotionLoop
from wayfarer.runtime.offline.lockstep import LockSteps
from wayfarer.runtime.scenes.desk import SceneDesk
from wayfarer.runtime.scenes.messages import Crowd, Outlines, SceneInfo, SceneWish, Way
from wayfarer.runtime.state.keeper import Keeper


class SceneCalls:
    """Implements `SceneService`."""

    def __init__(
        self, scenes: SceneDesk, keeper: Keeper, loop: MotionLoop, lock_steps: LockSteps
    ) -> None:
        self._scenes = scenes
        self._keeper = keeper
        self._loop = loop
        self._lock_steps = lock_steps

    async def create_scene(self, wish: SceneWish) -> SceneInfo:
        """See `SceneService`, as for all below."""
        return await self._keeper.durable(await self._scenes.create_scene(wish))

    async def get_scene(self, scene_id: str) -> SceneInfo:
        """See `SceneService`."""
        return await self._scenes.get_scene(scene_id)

    async def list_scenes(self) -> list[SceneInfo]:
        """See `SceneService`."""
        return await self._scenes.list_scenes()

    async def delete_scene(self, scene_id: str) -> None:
        """See `SceneService`."""
        await self._scenes.delete_scene(scene_id)
        await self._keeper.durable(None)

    async def put_obstacle(self, scene_id: str, name: str, obstacle: Obstacle) -> SceneInfo:
        """See `SceneService`."""
        made = await self._scenes.put_obstacle(scene_id, name, obstacle)
        return await self._keeper.durable(made)

    async def remove_obstacle(self, scene_id: str, name: str) -> SceneInfo:
        """See `SceneService`."""
        return await self._keeper.durable(await self._scenes.remove_obstacle(scene_id, name))

    async def query_path(self, scene_id: str, start: Point2 | Point3, goal: Point2 | Point3) -> Way:
        """See `SceneService`."""
        return await self._scenes.query_path(scene_id, start, goal)

    async def scene_outlines(self, scene_id: str) -> Outlines:
        """See `SceneService`."""
        return await self._scenes.scene_outlines(scene_id)

    async def scene_picture(self, scene_id: str) -> bytes:
        """See `SceneService`."""
        return await self._scenes.scene_picture(scene_id)

    async def populate(self, session_id: str, crowd: Crowd) -> int:
        """See `SceneService`."""
        if self._lock_steps.session(session_id):
            raise FailedPrecondition(
                f"session {session_id!r} is in lock-step: people come and go as time passes; "
                "create agents in it instead, and let them wander"
            )
        return await self._loop.ask(lambda world, now: world.populate(session_id, crowd, now))
