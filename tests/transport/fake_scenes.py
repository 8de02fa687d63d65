"""Scenes of the fake service. They are really baked, so best small; nobody walks in them."""

import asyncio
from dataclasses import replace
from typing import Any

from wayfarer.errors import FailedPrecondition, NotFound, Unreachable
from wayfarer.navigation.ground.ground import triangles
from wayfarer.navigation.picture import top_view
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import Obstacle, Point3
from wayfarer.world.scenes.messages import (
    Block,
    Crowd,
    CrowdState,
    Outlines,
    SceneInfo,
    SceneSource,
    Way,
)
from wayfarer.world.scenes.populate import CrowdPeople


class FakeScenes:
    """Ids count from 1: scene-1, scene-2 and so on."""

    def __init__(self) -> None:
        self.sources: list[SceneSource] = []
        self.crowds: list[tuple[str, Crowd]] = []
        self.guests: dict[str, str] = {}  # scene of each session
        self.people: list[str] = []  # ids of agents that came without a call
        self._scenes: dict[str, tuple[SceneSource, Scene]] = {}

    async def create_scene(self, source: SceneSource, scene_id: str = "") -> SceneInfo:
        scene = await asyncio.to_thread(bake, source.spec)
        self.sources.append(source)
        scene_id = scene_id or self.new_scene_id()
        self._scenes[scene_id] = source, scene
        return await self.get_scene(scene_id)

    def new_scene_id(self) -> str:
        return f"scene-{len(self.sources)}"

    def _scene(self, scene_id: str) -> Scene:
        if scene_id not in self._scenes:
            raise NotFound(f"no scene {scene_id!r}")
        return self._scenes[scene_id][1]

    async def get_scene(self, scene_id: str) -> SceneInfo:
        scene = self._scene(scene_id)
        source = self._scenes[scene_id][0]
        return SceneInfo(
            scene_id=scene_id,
            name=source.name,
            content_hash=scene.content_hash,
            version=scene.version,
            area=scene.area,
            islands=scene.islands,
            bounds=scene.bounds,
            obstacles=dict(scene.obstacles),
            sessions=list(self.guests.values()).count(scene_id),
            created_at=1_700_000_000.0,
            bake_s=0.01,
            attributes=source.attributes,
            notes=scene.notes,
        )

    async def list_scenes(self) -> list[SceneInfo]:
        return [await self.get_scene(scene_id) for scene_id in self._scenes]

    async def delete_scene(self, scene_id: str) -> None:
        self._scene(scene_id)
        if scene_id in self.guests.values():
            raise FailedPrecondition(f"sessions are in scene {scene_id!r}")
        del self._scenes[scene_id]

    def _change(self, scene_id: str, scene: Scene) -> None:
        self._scenes[scene_id] = self._scenes[scene_id][0], scene

    async def put_obstacle(self, scene_id: str, name: str, obstacle: Obstacle) -> SceneInfo:
        self._change(scene_id, self._scene(scene_id).put(name, obstacle))
        return await self.get_scene(scene_id)

    async def remove_obstacle(self, scene_id: str, name: str) -> SceneInfo:
        self._change(scene_id, self._scene(scene_id).remove(name))
        return await self.get_scene(scene_id)

    async def query_path(self, scene_id: str, start: Point3, goal: Point3) -> Way:
        try:
            path = self._scene(scene_id).path(start, goal)
        except Unreachable as error:
            raise error.explained() from None
        points = tuple((x, y, z) for x, y, z in path.points.tolist())
        return Way(points, path.length, path.start_moved, path.goal_moved, path.scene_version)

    async def scene_triangles(self, scene_id: str) -> Any:
        return triangles(self._scene(scene_id).spec)

    async def scene_outlines(self, scene_id: str) -> Outlines:
        scene = self._scene(scene_id)
        square = ((1.0, 2.0), (3.0, 2.0), (3.0, 4.0))
        block = Block(tuple((x, y, 1.5) for x, y in square), 0.5)
        return Outlines(
            walkable=((square, square[:2]),),
            vertices=((1.0, 2.0, 0.25),),
            triangles=((0, 1, 2),),
            solids=(block,),
            obstacles={name: replace(block, bottom=0.0) for name in scene.obstacles},
            version=scene.version,
        )

    async def scene_picture(self, scene_id: str) -> bytes:
        return top_view(self._scene(scene_id), pixels=64)

    async def populate(self, session_id: str, crowd: Crowd) -> CrowdState:
        self.crowds.append((session_id, crowd))
        return CrowdState(crowd.count, 0)

    async def crowd(self, session_id: str) -> CrowdPeople | None:
        crowds = [crowd for name, crowd in self.crowds if name == session_id]
        return CrowdPeople(crowds[-1], 0.0, leaves_at=dict.fromkeys(self.people, 0.0))
