"""Parameters that several routes take."""

from typing import Annotated, Any, Final

from fastapi import Header, Query
from fastapi import Path as InPath

from wayfarer.errors import InvalidArgument
from wayfarer.transport import schema
from wayfarer.transport.codec import PoseEncoding, PoseProfile

UINT32: Final = (1 << 32) - 1

SessionId = Annotated[
    str, InPath(max_length=schema.ID_LENGTH, description="as given by createSession")
]
AgentId = Annotated[
    str, InPath(max_length=schema.ID_LENGTH, description="as given by createAgents")
]
ModelName = Annotated[str, InPath(max_length=schema.ID_LENGTH, description="as in listModels")]
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
        pattern=r"^[^\x00-\x1f\x7f]*$",
        description="means the same as request_id in the body",
    ),
]

PROTOBUF: Final = "application/octet-stream"


def binary_body(description: str) -> dict[str, Any]:
    """OpenAPI's description of a body that is bytes."""
    content = {PROTOBUF: {"schema": {"type": "string", "format": "binary"}}}
    return {"requestBody": {"description": description, "required": True, "content": content}}


def binary_answer(description: str) -> dict[int | str, dict[str, Any]]:
    """OpenAPI's description of an answer that is bytes."""
    content = {PROTOBUF: {"schema": {"type": "string", "format": "binary"}}}
    return {200: {"description": description, "content": content}}


def request_id(in_body: str, in_header: str) -> str:
    """The one that was given. Raises InvalidArgument where they differ."""
    if in_body and in_header and in_body != in_header:
        raise InvalidArgument("request_id and Idempotency-Key differ; send one", "request_id")
    return in_body or in_header


def pose_format(
    encoding: Annotated[PoseEncoding, Query(description="how numbers are packed")] = (
        PoseEncoding.F32_LE
    ),
    profile: Annotated[PoseProfile, Query(description="which bones are sent")] = PoseProfile.BODY,
    bones: Annotated[
        list[str] | None, Query(max_length=52, description="with profile=bones: their names")
    ] = None,
    fps: Annotated[
        int, Query(ge=0, le=40, description="frames per second: 40, 20 or 10; 0: 40")
    ] = 0,
) -> schema.PoseFormat:
    """A dependency: how poses shall be packed."""
    return schema.PoseFormat(encoding=encoding, profile=profile, bones=tuple(bones or ()), fps=fps)
