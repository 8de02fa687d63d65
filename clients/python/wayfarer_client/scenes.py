"""Scenes: places in which agents find their way."""

import uuid
from collections.abc import AsyncIterator, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

from wayfarer_client.connection import Connection
from wayfarer_client.messages import Place, enum_label, vector
from wayfarer_client.shapes import Floor, Obstacle, Solid, Walkable, shape_to_wire
from wayfarer_client.v1 import common_pb2, scene_pb2

PIECE: Final = 256 * 1024
"""Bytes of one message of a mesh."""

MAKING_S: Final = 120.0
"""Seconds that making a scene may take."""


@dataclass(frozen=True, slots=True)
class Way:
    """A way that an agent would take."""

    points: tuple[Place, ...]  # from start to goal, on the ground
    length: float  # seen from above
    start_moved: float  # distance to the nearest free ground; 0: it was free
    goal_moved: float
    version: int  # of the scene


class SceneHandle(Protocol):
    """A `Scene` or a `SyncScene`."""

    scene_id: str


class Scene:
    """A scene of the server. It remains until it is deleted, or its lease ends."""

    def __init__(self, connection: Connection, message: scene_pb2.Scene) -> None:
        self._connection = connection
        self.scene_id = message.scene_id
        self.message = message
        """As it was when last requested: area_m2, islands, version, obstacles and more."""

    async def refresh(self) -> scene_pb2.Scene:
        """Refreshes `message`, and returns it."""
        request = scene_pb2.GetSceneRequest(scene_id=self.scene_id)
        self.message = (await self._call("GetScene", request)).scene
        return self.message

    async def delete(self) -> None:
        """Removes it. FailedPrecondition while sessions are in it."""
        await self._call("DeleteScene", scene_pb2.DeleteSceneRequest(scene_id=self.scene_id))

    async def put(self, name: str, obstacle: Obstacle) -> int:
        """Places or moves an obstacle; returns the scene's new version."""
        request = scene_pb2.PutObstacleRequest(
            scene_id=self.scene_id, name=name, obstacle=shape_to_wire(obstacle)
        )
        return int((await self._call("PutObstacle", request)).scene.version)

    async def remove(self, name: str) -> int:
        """Removes an obstacle; returns the scene's new version."""
        request = scene_pb2.RemoveObstacleRequest(scene_id=self.scene_id, name=name)
        return int((await self._call("RemoveObstacle", request)).scene.version)

    async def path(self, start: Place, goal: Place) -> Way:
        """The way that an agent would take. Raises Unreachable, with the nearest place."""
        request = scene_pb2.QueryPathRequest(
            scene_id=self.scene_id, start=vector(start), goal=vector(goal)
        )
        found = await self._call("QueryPath", request)
        points = tuple((p.x, p.y, p.z) for p in found.points)
        return Way(points, found.length, found.start_moved, found.goal_moved, found.version)

    async def outlines(self) -> scene_pb2.GetSceneOutlinesResponse:
        """The outlines to draw it."""
        request = scene_pb2.GetSceneOutlinesRequest(scene_id=self.scene_id)
        return await self._call("GetSceneOutlines", request)

    async def picture(self) -> bytes:
        """A picture from above, PNG; forward is up."""
        request = scene_pb2.GetScenePictureRequest(scene_id=self.scene_id)
        return bytes((await self._call("GetScenePicture", request)).picture)

    async def _call(self, method: str, request: Any) -> Any:
        return await self._connection.call(getattr(self._connection.scenes, method), request)


class Scenes:
    """The scenes of a server: `Client.scenes`."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    async def create(
        self,
        floors: Iterable[Floor] = (),
        solids: Iterable[Solid] = (),
        *,
        basis: str = "gltf",
        name: str = "",
        walkable: Walkable | None = None,
        entries: Sequence[Place] = (),
        lease: float | None = None,
        mesh: bytes | Path | None = None,
        mesh_format: str = "",
        mesh_basis: str = "",
        mesh_unit: float | None = None,
    ) -> Scene:
        """Makes a scene from floors and solids, from a mesh (a file, or its bytes), or from both.

        `entries`: ground that cannot be reached from there is left out. `lease`: seconds that the
        scene outlives its last session and call. `mesh_format`: glb, obj or ply; empty: by the
        file's name. `mesh_basis`: axes of its coordinates; empty: gltf for GLB, `basis` for others.
        `mesh_unit`: metres per unit of the file; None: the unit of `mesh_basis`.
        """
        request = scene_pb2.CreateSceneRequest(
            basis=enum_label(common_pb2.Basis, basis, "basis"),
            name=name,
            floors=[floor.to_wire() for floor in floors],
            solids=[shape_to_wire(solid) for solid in solids],
            walkable=(walkable or Walkable()).to_wire(),
            entries=[vector(entry) for entry in entries],
            lease_s=lease,
            request_id=str(uuid.uuid4()),
        )
        if mesh is None:
            method = self._connection.scenes.CreateScene
            reply = await self._connection.call(method, request, MAKING_S)
            return Scene(self._connection, reply.scene)
        if isinstance(mesh, Path):
            mesh_format, mesh = mesh_format or mesh.suffix[1:].lower(), mesh.read_bytes()
        what = scene_pb2.Mesh(
            format=enum_label(scene_pb2.MeshFormat, mesh_format or "glb", "mesh_format"),
            basis=enum_label(common_pb2.Basis, mesh_basis, "mesh_basis") if mesh_basis else None,
            unit=mesh_unit,
        )
        header = scene_pb2.MeshScene(scene=request, mesh=what)
        method = self._connection.scenes.CreateMeshScene
        reply = await self._connection.call(method, _Pieces(header, mesh), MAKING_S)
        return Scene(self._connection, reply.scene)

    async def examples(self) -> dict[str, str]:
        """The scenes that come with the server: a sentence for each name."""
        method, request = self._connection.scenes.ListExampleScenes, scene_pb2.ListScenesRequest()
        reply = await self._connection.call(method, request)
        return {example.name: example.summary for example in reply.examples}

    async def example(self, name: str, basis: str = "gltf", lease: float | None = None) -> Scene:
        """Makes one of the server's scenes. Raises NotFound."""
        request = scene_pb2.CreateExampleSceneRequest(
            name=name, basis=enum_label(common_pb2.Basis, basis, "basis"), lease_s=lease
        )
        method = self._connection.scenes.CreateExampleScene
        reply = await self._connection.create(method, request, MAKING_S)
        return Scene(self._connection, reply.scene)

    async def get(self, scene_id: str) -> Scene:
        """An existing scene. Raises NotFound."""
        request = scene_pb2.GetSceneRequest(scene_id=scene_id)
        reply = await self._connection.call(self._connection.scenes.GetScene, request)
        return Scene(self._connection, reply.scene)

    async def all(self) -> list[Scene]:
        """The scenes of this caller, oldest first."""
        request = scene_pb2.ListScenesRequest()
        reply = await self._connection.call(self._connection.scenes.ListScenes, request)
        return [Scene(self._connection, message) for message in reply.scenes]


@dataclass(frozen=True, slots=True)
class _Pieces:
    """The messages that bring a mesh; they can be sent again."""

    header: scene_pb2.MeshScene
    data: bytes

    async def __aiter__(self) -> AsyncIterator[scene_pb2.CreateMeshSceneRequest]:
        yield scene_pb2.CreateMeshSceneRequest(header=self.header)
        for start in range(0, len(self.data), PIECE):
            yield scene_pb2.CreateMeshSceneRequest(data=self.data[start : start + PIECE])
