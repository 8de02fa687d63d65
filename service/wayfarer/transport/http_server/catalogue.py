"""Routes that only HTTP has: figures of the motion loop, body meshes."""

import hashlib
import re
from functools import lru_cache
from typing import Annotated, Final

import numpy as np
from fastapi import APIRouter, Query, Request, Response
from fastapi import Path as InPath
from fastapi.concurrency import run_in_threadpool

from wayfarer.body.glb import body_glb
from wayfarer.body.library import Detail
from wayfarer.body.outfit import OUTFIT_TEXT
from wayfarer.errors import InvalidArgument, NotFound
from wayfarer.spec import BETAS
from wayfarer.transport import schema
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway

BETA: Final = r"-?[0-9](\.[0-9]{0,20})?(e-[0-9]{1,3})?"
"""One shape coefficient as text, as JavaScript and Python write it."""

SHAPE: Final = f"^({BETA}(,{BETA}){{{BETAS - 1}}})?$"
SHAPE_TEXT: Final = f"{BETAS} numbers between -10 and 10, with commas; none: mean body"


def catalogue_routes(gateway: Gateway) -> APIRouter:
    """`/v1/stats`, `/v1/bodies`."""
    router = APIRouter(prefix="/v1", tags=["catalogue"])

    @router.get("/stats", operation_id="getStats", summary="Health of the motion loop")
    async def get_stats() -> schema.Stats:
        """Over the last few seconds, or since start."""
        return await gateway.catalogue.stats()

    @router.get(
        "/bodies/{body}-{gender}.glb",
        operation_id="getBody",
        summary="A skinned body in T-pose, glTF binary",
        response_class=Response,
        responses={200: {"content": {"model/gltf-binary": {}}}, 304: {"description": "unchanged"}},
    )
    async def get_body(
        request: Request,
        body: Annotated[str, InPath(max_length=schema.ID_LENGTH)],
        gender: Annotated[str, InPath(max_length=schema.ID_LENGTH)],
        betas: Annotated[
            str,
            Query(
                max_length=400,
                description=SHAPE_TEXT,
                json_schema_extra={"pattern": SHAPE},
            ),
        ] = "",
        detail: Annotated[Detail, Query(description="mesh resolution")] = "high",
        style: Annotated[
            int, Query(ge=0, lt=1 << 32, description="seed of its look: the agent's")
        ] = 0,
        outfit: Annotated[str, Query(max_length=64, description=OUTFIT_TEXT)] = "",
    ) -> Response:
        """Always in the glTF basis; joint nodes carry the canonical bone names."""
        bodies = gateway.body_library
        if body != bodies.name or gender not in list(schema.Gender):
            known = ", ".join(f"{bodies.name}-{known}" for known in schema.Gender)
            raise NotFound(f"there is no body {body}-{gender}; there are {known}", "body", body)
        made = await run_in_threadpool(_glb, bodies, gender, _numbers(betas), detail, style, outfit)
        headers = {"etag": made[0], "cache-control": "public, max-age=3600"}
        if request.headers.get("if-none-match") == made[0]:
            return Response(status_code=304, headers=headers)
        return Response(made[1], media_type="model/gltf-binary", headers=headers)

    return router


@lru_cache(maxsize=16)
def _glb(
    bodies: BodyLibrary,
    gender: str,
    betas: tuple[float, ...],
    detail: Detail,
    style: int,
    outfit: str,
) -> tuple[str, bytes]:
    """ETag and file."""
    data = body_glb(bodies.model(gender, detail), np.array(betas), style, outfit)
    return f'"{hashlib.sha256(data).hexdigest()[:32]}"', data


def _numbers(text: str) -> tuple[float, ...]:
    """Betas in a query. Raises InvalidArgument."""
    if not re.fullmatch(SHAPE, text):
        raise InvalidArgument(f"must be {SHAPE_TEXT}", "betas")
    return tuple(float(part) for part in text.split(",")) if text else (0.0,) * BETAS
