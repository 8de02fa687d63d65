"""Endpoints of SceneService that take or give files."""

import re
from typing import Annotated, Any, Final

from fastapi import Depends, Query, Request, Response
from fastapi import Path as InPath
from pydantic import ValidationError

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.checks import UNIT, WALKABLE
from wayfarer.transport import schema
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.conversion.violations import invalid_request
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.http_server.calls import Special
from wayfarer.transport.http_server.parameters import (
    IdempotencyKey,
    binary_body,
    fields_of,
    request_id,
)

PNG: Final = "image/png"
NUMBER: Final = r"-?[0-9]{1,7}(\.[0-9]{1,9})?"
"""One coordinate as text."""
PLACE: Final = f"^{NUMBER}(,{NUMBER}){{2}}$"

SceneId = Annotated[str, InPath(max_length=schema.ID_LENGTH, description="as given by createScene")]
Number = Annotated[float | None, Query(allow_inf_nan=False)]
PICTURE: Final[dict[int | str, dict[str, Any]]] = {
    200: {
        "description": "seen from above, forward is up",
        "content": {PNG: {"schema": {"type": "string", "format": "binary"}}},
    }
}


def scene_endpoints(gateway: Gateway) -> Special:
    """Endpoints that take or give a file."""
    scenes = gateway.scenes

    async def create_mesh_scene(
        request: Request,
        described: Annotated[schema.MeshScene, Depends(mesh_scene)],
        idempotency_key: IdempotencyKey = "",
    ) -> schema.Scene:
        known_as = request_id(described.scene.request_id, idempotency_key)
        scene = described.scene.model_copy(update={"request_id": known_as})
        named = described.model_copy(update={"scene": scene})
        with fields_of("walkable"):
            return await scenes.create_from_mesh(named, request.stream())

    async def get_scene_picture(scene_id: SceneId) -> Response:
        return Response(await scenes.picture(scene_id), media_type=PNG)

    mesh = binary_body("the file, at most limits.mesh_bytes")
    return {
        "CreateMeshScene": (create_mesh_scene, {"openapi_extra": mesh}),
        "GetScenePicture": (
            get_scene_picture,
            {"response_class": Response, "responses": PICTURE},
        ),
    }


def _walkable(name: str) -> Any:
    """The query parameter of a field of createScene's `walkable`."""
    low, high = WALKABLE[name]
    if name == "slope_deg":
        return Query(ge=low, le=high, description=f"as walkable.{name} of createScene")
    extra = schema.bounds(low, high)
    return Query(json_schema_extra=extra, description=f"as walkable.{name} of createScene")


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
    radius: Annotated[Number, _walkable("radius")] = None,
    step_height: Annotated[Number, _walkable("step_height")] = None,
    slope_deg: Annotated[Number, _walkable("slope_deg")] = None,
    height: Annotated[Number, _walkable("height")] = None,
    entry: Annotated[
        list[Annotated[str, Query(json_schema_extra={"pattern": PLACE})]] | None,
        Query(max_length=64, description="as entries: x,y,z; may be repeated"),
    ] = None,
    lease_s: Annotated[Number, Query(ge=1, description="as createScene has it")] = None,
    request_id: Annotated[str, Query(max_length=64, description="as createScene has it")] = "",
) -> schema.MeshScene:
    """A dependency: the scene to make of a mesh. Raises InvalidArgument."""
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
