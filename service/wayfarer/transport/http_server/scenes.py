"""Routes of SceneService."""

import re
from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi import Path as InPath
from pydantic import ValidationError

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.checks import HEIGHT, RADIUS, SLOPE_DEG, STEP_HEIGHT, UNIT
from wayfarer.transport import schema
from wayfarer.transport.basis import Basis
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.http_server.parameters import (
    IdempotencyKey,
    SessionId,
    binary_body,
    fields_of,
    request_id,
)
from wayfarer.transport.violations import invalid_request

PNG: Final = "image/png"
NUMBER: Final = r"-?[0-9]{1,7}(\.[0-9]{1,9})?"
"""One coordinate as text."""
PLACE: Final = f"^{NUMBER}(,{NUMBER}){{2}}$"

SceneId = Annotated[str, InPath(max_length=schema.ID_LENGTH, description="as given by createScene")]
ExampleName = Annotated[
    str, InPath(max_length=schema.ID_LENGTH, description="as in listExampleScenes")
]
ObstacleName = Annotated[
    str, InPath(min_length=1, max_length=64, description="of the client's own making")
]
Number = Annotated[float | None, Query(allow_inf_nan=False)]
PICTURE: Final[dict[int | str, dict[str, Any]]] = {
    200: {
        "description": "seen from above, forward is up",
        "content": {PNG: {"schema": {"type": "string", "format": "binary"}}},
    }
}


def scene_routes(gateway: Gateway) -> APIRouter:
    """`/v1/scenes`."""
    router = APIRouter(prefix="/v1/scenes", tags=["scenes"])
    scenes = gateway.scenes

    @router.post("", status_code=201, operation_id="createScene", summary="Make a scene")
    async def create_scene(
        request: schema.NewScene, idempotency_key: IdempotencyKey = ""
    ) -> schema.Scene:
        """A scene of floors and solids. Sessions name its id as `scene` to be created in it."""
        known_as = request_id(request.request_id, idempotency_key)
        return await scenes.create(request.model_copy(update={"request_id": known_as}))

    @router.post(
        "/mesh",
        status_code=201,
        operation_id="createMeshScene",
        summary="Make a scene from a mesh",
        openapi_extra=binary_body("the file, at most limits.mesh_bytes"),
    )
    async def create_mesh_scene(
        request: Request,
        described: Annotated[schema.MeshScene, Depends(mesh_scene)],
        idempotency_key: IdempotencyKey = "",
    ) -> schema.Scene:
        """A scene of a GLB, OBJ or PLY file. 429 while other uploads take the room."""
        known_as = request_id(described.scene.request_id, idempotency_key)
        scene = described.scene.model_copy(update={"request_id": known_as})
        named = described.model_copy(update={"scene": scene})
        with fields_of("walkable"):
            return await scenes.create_from_mesh(named, request.stream())

    @router.get(
        "/examples", operation_id="listExampleScenes", summary="Scenes that come with the server"
    )
    async def list_example_scenes() -> schema.ExampleScenes:
        return scenes.examples()

    @router.post(
        "/examples/{name}",
        status_code=201,
        operation_id="createExampleScene",
        summary="Make a scene that comes with the server",
    )
    async def create_example_scene(
        name: ExampleName,
        request: schema.NewExampleScene | None = None,
        idempotency_key: IdempotencyKey = "",
    ) -> schema.Scene:
        """It is the caller's own from then on."""
        request = request or schema.NewExampleScene()
        known_as = request_id(request.request_id, idempotency_key)
        return await scenes.create_example(
            name, request.model_copy(update={"request_id": known_as})
        )

    @router.get("", operation_id="listScenes", summary="Describe the caller's scenes")
    async def list_scenes() -> schema.Scenes:
        """Oldest first; a caller with the scope admin sees all. Renews no lease."""
        return await scenes.list_own()

    @router.get("/{scene_id}", operation_id="getScene", summary="Describe a scene")
    async def get_scene(scene_id: SceneId) -> schema.Scene:
        return await scenes.get(scene_id)

    @router.delete(
        "/{scene_id}", status_code=204, operation_id="deleteScene", summary="Remove a scene"
    )
    async def delete_scene(scene_id: SceneId) -> None:
        """409 while sessions are in it."""
        await scenes.delete(scene_id)

    @router.put(
        "/{scene_id}/obstacles/{name}",
        operation_id="putObstacle",
        summary="Add or move an obstacle",
    )
    async def put_obstacle(
        scene_id: SceneId, name: ObstacleName, request: schema.Obstacle
    ) -> schema.SceneVersion:
        """Agents whose way it blocks plan again. 409 when no free ground would be left."""
        return await scenes.put_obstacle(scene_id, name, request)

    @router.delete(
        "/{scene_id}/obstacles/{name}",
        operation_id="removeObstacle",
        summary="Remove an obstacle",
    )
    async def remove_obstacle(scene_id: SceneId, name: ObstacleName) -> schema.SceneVersion:
        return await scenes.remove_obstacle(scene_id, name)

    @router.post(
        "/{scene_id}/path",
        operation_id="queryPath",
        summary="The way that an agent would take",
    )
    async def query_path(scene_id: SceneId, request: schema.PathQuery) -> schema.ScenePath:
        """409 of type unreachable when no way leads there, with the `nearest` reachable place."""
        return await scenes.query_path(scene_id, request)

    @router.get(
        "/{scene_id}/outlines",
        operation_id="getSceneOutlines",
        summary="What is needed to draw a scene",
    )
    async def get_scene_outlines(scene_id: SceneId) -> schema.SceneOutlines:
        """Its walkable ground, its solids, its obstacles."""
        return await scenes.outlines(scene_id)

    @router.get(
        "/{scene_id}/picture",
        operation_id="getScenePicture",
        summary="A picture of a scene from above",
        response_class=Response,
        responses=PICTURE,
    )
    async def get_scene_picture(scene_id: SceneId) -> Response:
        """Green is where the middle of an agent may be, brown are obstacles."""
        return Response(await scenes.picture(scene_id), media_type=PNG)

    return router


def crowd_routes(gateway: Gateway) -> APIRouter:
    """The crowd of a session."""
    router = APIRouter(prefix="/v1/sessions", tags=["scenes"])

    @router.post(
        "/{session_id}/crowd",
        operation_id="populateSession",
        summary="Populate a session's scene with walking people",
    )
    async def populate_session(session_id: SessionId, request: schema.Crowd) -> schema.CrowdCame:
        """They replace the crowd of an earlier call. 409 for a session without a scene."""
        return await gateway.scenes.populate(session_id, request)

    return router


async def mesh_scene(
    format: Annotated[schema.MeshFormat, Query(description="of the file")] = schema.MeshFormat.GLB,
    basis: Annotated[Basis, Query(description="of all calls on the scene")] = Basis.GLTF,
    mesh_basis: Annotated[
        Basis | None,
        Query(description="axes of the file's coordinates; gltf for GLB, else as `basis`"),
    ] = None,
    unit: Annotated[
        Number, Query(ge=UNIT[0], le=UNIT[1], description="metres per unit of the file")
    ] = None,
    name: Annotated[str, Query(max_length=64, description="to show; need not be unique")] = "",
    radius: Annotated[
        Number,
        Query(
            description="as walkable.radius of createScene",
            json_schema_extra=schema.bounds(*RADIUS),
        ),
    ] = None,
    step_height: Annotated[
        Number,
        Query(description="as walkable.step_height", json_schema_extra=schema.bounds(*STEP_HEIGHT)),
    ] = None,
    slope_deg: Annotated[
        Number, Query(ge=SLOPE_DEG[0], le=SLOPE_DEG[1], description="as walkable.slope_deg")
    ] = None,
    height: Annotated[
        Number,
        Query(description="as walkable.height", json_schema_extra=schema.bounds(*HEIGHT)),
    ] = None,
    entry: Annotated[
        list[Annotated[str, Query(json_schema_extra={"pattern": PLACE})]] | None,
        Query(max_length=64, description="as entries: x,y,z; may be repeated"),
    ] = None,
    lease_s: Annotated[Number, Query(ge=1, description="as createScene has it")] = None,
    request_id: Annotated[str, Query(max_length=64, description="as createScene has it")] = "",
) -> schema.MeshScene:
    """A dependency: what a mesh shall become. Raises InvalidArgument."""
    walkable = {
        "radius": radius,
        "step_height": step_height,
        "slope_deg": slope_deg,
        "height": height,
    }
    for k, text in enumerate(entry or ()):
        if not re.fullmatch(PLACE, text):
            raise InvalidArgument("must be x,y,z: three numbers with commas", f"entry[{k}]")
    entries = [dict(zip("xyz", map(float, text.split(",")), strict=True)) for text in entry or ()]
    scene = {
        "basis": basis,
        "name": name,
        "walkable": walkable,
        "entries": entries,
        "lease_s": lease_s,
        "request_id": request_id,
    }
    mesh = {"format": format, "basis": mesh_basis, "unit": unit}
    try:
        return schema.MeshScene.model_validate({"scene": scene, "mesh": mesh})
    except ValidationError as error:
        raise invalid_request(error) from None
