"""Parameters that several routes take."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Final

from fastapi import Header, Query, Request, params
from fastapi import Path as InPath
from fastapi.dependencies.utils import get_flat_params
from pydantic import ValidationError

from wayfarer.errors import InvalidArgument, unknown_name
from wayfarer.transport import schema
from wayfarer.transport.codec import PoseEncoding, PoseProfile
from wayfarer.transport.codec.pose_format import RATES
from wayfarer.transport.conversion.violations import invalid_request, renamed

UINT32: Final = (1 << 32) - 1

SessionId = Annotated[
    str, InPath(max_length=schema.ID_LENGTH, description="as given by createSession")
]
Expected = Annotated[
    int | None,
    Query(
        ge=0,
        le=UINT32,
        description="the agent's goal_revision that the change is meant for; 409 at another",
    ),
]
IdempotencyKey = Annotated[
    str,
    Header(
        max_length=64,
        pattern=schema.LINE,
        description="means the same as request_id in the body",
    ),
]

PROTOBUF: Final = "application/octet-stream"


def binary_body(description: str) -> dict[str, Any]:
    """OpenAPI description of a body of bytes."""
    content = {PROTOBUF: {"schema": {"type": "string", "format": "binary"}}}
    return {"requestBody": {"description": description, "required": True, "content": content}}


def binary_answer(description: str) -> dict[int | str, dict[str, Any]]:
    """OpenAPI description of an answer of bytes."""
    content = {PROTOBUF: {"schema": {"type": "string", "format": "binary"}}}
    return {200: {"description": description, "content": content}}


def request_id(in_body: str, in_header: str) -> str:
    """Returns whichever is given. Raises InvalidArgument if they differ."""
    if in_body and in_header and in_body != in_header:
        raise InvalidArgument("request_id and Idempotency-Key differ; send one", "request_id")
    return in_body or in_header


async def only_known_query(request: Request) -> None:
    """A dependency that refuses query parameters the route does not have. Raises InvalidArgument.

    If a misspelt `expected_revision` were ignored, the command would apply without its protection.
    """
    parameters = get_flat_params(request.scope["route"].dependant)
    known = [each.alias for each in parameters if isinstance(each.field_info, params.Query)]
    unknown = [name[: schema.ID_LENGTH] for name in request.query_params if name not in known]
    if unknown:
        raise InvalidArgument(unknown_name(unknown[0], known), unknown[0])


@contextmanager
def fields_of(message: str) -> Iterator[None]:
    """Names fields of `message` without it: the RPC's field is HTTP's whole request."""
    try:
        yield
    except InvalidArgument as error:
        raise renamed(error, error.field.removeprefix(f"{message}.")) from None


async def pose_format(
    encoding: Annotated[PoseEncoding, Query(description="how numbers are packed")] = (
        PoseEncoding.F32_LE
    ),
    profile: Annotated[PoseProfile, Query(description="which bones are sent")] = PoseProfile.BODY,
    bones: Annotated[
        list[schema.BoneName] | None,
        Query(max_length=52, description="with profile=bones, and only then: their names"),
    ] = None,
    fps: Annotated[
        int,
        Query(
            description="frames per second; 0: 40",
            json_schema_extra={"enum": [0, *sorted(RATES)]},
        ),
    ] = 0,
) -> schema.PoseFormat:
    """A dependency: the pose format. Raises InvalidArgument."""
    chosen = {"encoding": encoding, "profile": profile, "bones": bones or (), "fps": fps}
    try:
        return schema.PoseFormat.model_validate(chosen)
    except ValidationError as error:
        raise invalid_request(error) from None
