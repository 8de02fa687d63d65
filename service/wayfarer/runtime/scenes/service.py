"""The scenes' part of the runtime's one door (`runtime/service.py`)."""

from typing import Protocol

from wayfarer.navigation.spec import Obstacle, Point2, Point3
from wayfarer.runtime.scenes.messages import Crowd, Outlines, SceneInfo, SceneWish, Way


class SceneService(Protocol):
    """Scenes, their obstacles, ways through them, and the people who live there.

    A session is in at most one scene, named when it is created (`SessionSpec.scene`).
    """

    async def create_scene(self, wish: SceneWish) -> SceneInfo:
        """Bake it, off the motion thread; equal content is baked once.

        Raises InvalidArgument that names the field, ResourceExhausted when too many are kept or
        being baked, or when this one is too costly.
        """
        ...

    async def get_scene(self, scene_id: str) -> SceneInfo:
        """Raises NotFound."""
        ...

    async def list_scenes(self) -> list[SceneInfo]:
        """All, oldest first."""
        ...

    async def delete_scene(self, scene_id: str) -> None:
        """Raises NotFound; FailedPrecondition while sessions are in it."""
        ...

    async def put_obstacle(self, scene_id: str, name: str, obstacle: Obstacle) -> SceneInfo:
        """Let it stand there, or move there; agents in whose way it is plan anew.

        Raises NotFound, InvalidArgument, ResourceExhausted, and FailedPrecondition when no free
        ground would be left.
        """
        ...

    async def remove_obstacle(self, scene_id: str, name: str) -> SceneInfo:
        """Raises NotFound."""
        ...

    async def query_path(self, scene_id: str, start: Point2 | Point3, goal: Point2 | Point3) -> Way:
        """The way an agent would take. Raises NotFound, InvalidArgument, Unreachable."""
        ...

    async def scene_outlines(self, scene_id: str) -> Outlines:
        """To draw it. Raises NotFound."""
        ...

    async def scene_picture(self, scene_id: str) -> bytes:
        """A top view, PNG. Raises NotFound."""
        ...

    async def populate(self, session_id: str, crowd: Crowd) -> int:
        """Let people come and go from now on, in place of an earlier crowd; how many came at once.

        With `count` 0 those there leave. Raises NotFound, FailedPrecondition when the session is in
        no scene, InvalidArgument, ResourceExhausted when so many could not be stepped in time.
        """
        ...
