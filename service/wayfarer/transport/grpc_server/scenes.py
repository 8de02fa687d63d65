"""SceneService over the gateway."""

import asyncio
from collections.abc import AsyncIterator
from typing import Final

from grpc.aio import ServicerContext as Context

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.spec import MAX_POINTS
from wayfarer.transport import schema, wire
from wayfarer.transport.gateway import Gateway
from wayfarer.v1 import scene_pb2, scene_pb2_grpc

FIRST_S: Final = 10.0
"""A client that sends a mesh says within so long what it is."""

Pieces = AsyncIterator[scene_pb2.CreateMeshSceneRequest]


class SceneService(scene_pb2_grpc.SceneServiceServicer):
    """See scene.proto."""

    def __init__(self, gateway: Gateway) -> None:
        self._scenes = gateway.scenes

    async def CreateScene(  # noqa: N802
        self, request: scene_pb2.CreateSceneRequest, context: Context
    ) -> scene_pb2.CreateSceneResponse:
        """Make a scene."""
        wish = await asyncio.to_thread(_parsed, request)  # a large one takes a while
        scene = await self._scenes.create(wish)
        return scene_pb2.CreateSceneResponse(scene=wire.message(scene_pb2.Scene, scene))

    async def CreateMeshScene(  # noqa: N802
        self, request_iterator: Pieces, context: Context
    ) -> scene_pb2.CreateMeshSceneResponse:
        """Make a scene from a mesh."""
        header = await _header(request_iterator)
        _check_points(header.scene, "header.scene.")
        wish = await asyncio.to_thread(wire.parse, schema.MeshScene, header, "header")
        scene = await self._scenes.create_from_mesh(wish, _data(request_iterator))
        return scene_pb2.CreateMeshSceneResponse(scene=wire.message(scene_pb2.Scene, scene))

    async def ListExampleScenes(  # noqa: N802
        self, request: scene_pb2.ListExampleScenesRequest, context: Context
    ) -> scene_pb2.ListExampleScenesResponse:
        """The scenes that come with the server."""
        return wire.message(scene_pb2.ListExampleScenesResponse, self._scenes.examples())

    async def CreateExampleScene(  # noqa: N802
        self, request: scene_pb2.CreateExampleSceneRequest, context: Context
    ) -> scene_pb2.CreateExampleSceneResponse:
        """Make one of them."""
        wish = wire.parse(schema.NewExampleScene, request)
        scene = await self._scenes.create_example(request.name, wish)
        return scene_pb2.CreateExampleSceneResponse(scene=wire.message(scene_pb2.Scene, scene))

    async def GetScene(  # noqa: N802
        self, request: scene_pb2.GetSceneRequest, context: Context
    ) -> scene_pb2.GetSceneResponse:
        """Describe a scene."""
        scene = await self._scenes.get(request.scene_id)
        return scene_pb2.GetSceneResponse(scene=wire.message(scene_pb2.Scene, scene))

    async def ListScenes(  # noqa: N802
        self, request: scene_pb2.ListScenesRequest, context: Context
    ) -> scene_pb2.ListScenesResponse:
        """Describe the caller's scenes."""
        return wire.message(scene_pb2.ListScenesResponse, await self._scenes.list_own())

    async def DeleteScene(  # noqa: N802
        self, request: scene_pb2.DeleteSceneRequest, context: Context
    ) -> scene_pb2.DeleteSceneResponse:
        """Remove a scene."""
        await self._scenes.delete(request.scene_id)
        return scene_pb2.DeleteSceneResponse()

    async def PutObstacle(  # noqa: N802
        self, request: scene_pb2.PutObstacleRequest, context: Context
    ) -> scene_pb2.PutObstacleResponse:
        """Let an obstacle stand somewhere."""
        wish = wire.parse(schema.Obstacle, request.obstacle, "obstacle")
        version = await self._scenes.put_obstacle(request.scene_id, request.name, wish)
        return scene_pb2.PutObstacleResponse(scene=wire.message(scene_pb2.SceneVersion, version))

    async def RemoveObstacle(  # noqa: N802
        self, request: scene_pb2.RemoveObstacleRequest, context: Context
    ) -> scene_pb2.RemoveObstacleResponse:
        """Take an obstacle away."""
        version = wire.message(
            scene_pb2.SceneVersion,
            await self._scenes.remove_obstacle(request.scene_id, request.name),
        )
        return scene_pb2.RemoveObstacleResponse(scene=version)

    async def QueryPath(  # noqa: N802
        self, request: scene_pb2.QueryPathRequest, context: Context
    ) -> scene_pb2.QueryPathResponse:
        """The way that an agent would take."""
        wish = wire.parse(schema.PathQuery, request)
        path = await self._scenes.query_path(request.scene_id, wish)
        return wire.message(scene_pb2.QueryPathResponse, path)

    async def GetSceneOutlines(  # noqa: N802
        self, request: scene_pb2.GetSceneOutlinesRequest, context: Context
    ) -> scene_pb2.GetSceneOutlinesResponse:
        """What is needed to draw a scene."""
        found = await self._scenes.outlines(request.scene_id)
        return await asyncio.to_thread(wire.message, scene_pb2.GetSceneOutlinesResponse, found)

    async def GetScenePicture(  # noqa: N802
        self, request: scene_pb2.GetScenePictureRequest, context: Context
    ) -> scene_pb2.GetScenePictureResponse:
        """A picture of a scene."""
        picture = await self._scenes.picture(request.scene_id)
        return scene_pb2.GetScenePictureResponse(picture=picture)

    async def PopulateSession(  # noqa: N802
        self, request: scene_pb2.PopulateSessionRequest, context: Context
    ) -> scene_pb2.PopulateSessionResponse:
        """Let people come into a session's scene."""
        came = await self._scenes.populate(request.session_id, wire.parse(schema.Crowd, request))
        return wire.message(scene_pb2.PopulateSessionResponse, came)


def _parsed(request: scene_pb2.CreateSceneRequest) -> schema.NewScene:
    _check_points(request)
    return wire.parse(schema.NewScene, request)


def _check_points(request: scene_pb2.CreateSceneRequest, where: str = "") -> None:
    """Raise InvalidArgument for so many points that only to read them would take seconds.

    An empty Vector3 has two bytes.
    """
    holes = sum(len(hole.points) for floor in request.floors for hole in floor.holes)
    outlines = sum(len(floor.outline) for floor in request.floors)
    prisms = sum(len(solid.prism.outline) for solid in request.solids)
    if (points := holes + outlines + prisms) > MAX_POINTS:
        field = where + ("solids" if prisms > holes + outlines else "floors")
        raise InvalidArgument(f"outlines have {points} points; allowed: {MAX_POINTS}", field)


async def _header(requests: Pieces) -> scene_pb2.MeshScene:
    """What the first message says. Raises InvalidArgument."""
    wrong = InvalidArgument("the first message must be `header`", "header")
    try:
        async with asyncio.timeout(FIRST_S):
            first = await anext(requests)
    except (TimeoutError, StopAsyncIteration):
        raise wrong from None
    if first.WhichOneof("payload") != "header":
        raise wrong
    return first.header


async def _data(requests: Pieces) -> AsyncIterator[bytes]:
    """What the others bring. Raises InvalidArgument."""
    async for request in requests:
        if request.WhichOneof("payload") != "data":
            raise InvalidArgument("after `header` comes only `data`", "data")
        yield request.data
