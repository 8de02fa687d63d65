"""Scenes for programs without an event loop."""

from collections.abc import Callable, Coroutine
from typing import Any

from wayfarer_client.messages import Place
from wayfarer_client.scenes import Scene, Scenes, Way
from wayfarer_client.shapes import Obstacle
from wayfarer_client.v1 import scene_pb2

Run = Callable[[Coroutine[Any, Any, Any]], Any]


class SyncScene:
    """As `Scene`."""

    def __init__(self, scene: Scene, run: Run) -> None:
        self._scene = scene
        self._run = run
        self.scene_id = scene.scene_id

    @property
    def message(self) -> scene_pb2.Scene:
        """See `Scene.message`."""
        return self._scene.message

    def refresh(self) -> scene_pb2.Scene:
        """See `Scene.refresh`, as for all below."""
        return self._run(self._scene.refresh())

    def delete(self) -> None:
        """See `Scene.delete`."""
        self._run(self._scene.delete())

    def put(self, name: str, obstacle: Obstacle) -> int:
        """See `Scene.put`."""
        return int(self._run(self._scene.put(name, obstacle)))

    def remove(self, name: str) -> int:
        """See `Scene.remove`."""
        return int(self._run(self._scene.remove(name)))

    def path(self, start: Place, goal: Place) -> Way:
        """See `Scene.path`."""
        found: Way = self._run(self._scene.path(start, goal))
        return found

    def outlines(self) -> scene_pb2.GetSceneOutlinesResponse:
        """See `Scene.outlines`."""
        return self._run(self._scene.outlines())

    def picture(self) -> bytes:
        """See `Scene.picture`."""
        return bytes(self._run(self._scene.picture()))


class SyncScenes:
    """As `Scenes`."""

    def __init__(self, scenes: Scenes, run: Run) -> None:
        self._scenes = scenes
        self._run = run

    def create(self, *what: Any, **how: Any) -> SyncScene:
        """See `Scenes.create`, as for all below."""
        return SyncScene(self._run(self._scenes.create(*what, **how)), self._run)

    def examples(self) -> dict[str, str]:
        """See `Scenes.examples`."""
        return dict(self._run(self._scenes.examples()))

    def example(self, name: str, basis: str = "gltf", lease: float | None = None) -> SyncScene:
        """See `Scenes.example`."""
        return SyncScene(self._run(self._scenes.example(name, basis, lease)), self._run)

    def get(self, scene_id: str) -> SyncScene:
        """See `Scenes.get`."""
        return SyncScene(self._run(self._scenes.get(scene_id)), self._run)

    def all(self) -> list[SyncScene]:
        """See `Scenes.all`."""
        return [SyncScene(scene, self._run) for scene in self._run(self._scenes.all())]
