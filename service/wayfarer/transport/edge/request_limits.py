"""Around the HTTP routes: request limits, headers, problem documents."""

import json
import mimetypes
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from wayfarer.errors import InvalidArgument, WayfarerError
from wayfarer.transport import errors
from wayfarer.transport.conversion.violations import refusal, sentence

log = structlog.get_logger(__name__)


def _described(*codes: errors.Code) -> dict[int | str, dict[str, Any]]:
    titles: dict[int, list[str]] = {}
    for code in codes:
        titles.setdefault(int(code.http), []).append(code.title)
    problem = {errors.PROBLEM_JSON: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    return {
        status: {"description": " or ".join(found), "content": problem}
        for status, found in titles.items()
    }


PROBLEMS: Final = _described(
    *errors.TABLE.values(), errors.TOO_LARGE, errors.COMPRESSED, errors.INTERNAL
)
"""OpenAPI's description of every error answer."""

# The machine's own table may lack these, or have wrong ones.
for suffix, kind in ((".js", "text/javascript"), (".glb", "model/gltf-binary")):
    mimetypes.add_type(kind, suffix)


MESHES: Final = "/v1/scenes/mesh"
"""Path that takes files larger than other requests."""

COMPRESSED: Final = HTTPException(
    errors.COMPRESSED.http,
    "content-encoding: only identity is taken; send the body uncompressed",
    {"accept-encoding": "identity"},
)


@dataclass(eq=False)
class RequestLimits:
    """ASGI middleware: limits request bodies and sets the headers of every answer."""

    app: ASGIApp
    body_bytes: int
    mesh_bytes: int

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuses a body that is compressed or too large, even if its length is not announced."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        most = left = self.mesh_bytes if scope["path"] == MESHES else self.body_bytes
        too_large = HTTPException(errors.TOO_LARGE.http, f"a request has {most} bytes at most")

        async def bounded_receive() -> Message:
            nonlocal left
            message = await receive()
            left -= len(message.get("body", b""))
            if left < 0:
                raise too_large
            return message

        async def headed_send(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.setdefault("cache-control", "no-store")
                headers.setdefault("x-content-type-options", "nosniff")
            await send(message)

        headers = Headers(scope=scope)
        length = headers.get("content-length", "0")
        if length.isdigit() and int(length) > most:
            await _http_problem(too_large)(scope, receive, headed_send)
            return
        codings = ",".join(headers.getlist("content-encoding")).lower().split(",")
        if {coding.strip() for coding in codings} - {"", "identity"}:
            await _http_problem(COMPRESSED)(scope, receive, headed_send)
            return
        await self.app(scope, bounded_receive, headed_send)


def add_problem_handlers(app: FastAPI) -> None:
    """Answers every failure with an RFC 9457 problem document."""

    @app.exception_handler(WayfarerError)
    async def on_error(request: Request, error: WayfarerError) -> Response:
        errors.log_unexpected(log, error, request.url.path)
        return problem_response(error)

    @app.exception_handler(RequestValidationError)
    async def on_validation(request: Request, error: RequestValidationError) -> Response:
        return problem_response(_refusal(request, error))

    @app.exception_handler(HTTPException)
    async def on_http(request: Request, error: HTTPException) -> Response:
        if error.status_code == HTTPStatus.BAD_REQUEST:  # FastAPI cannot read the body
            return problem_response(InvalidArgument("the body is not JSON in UTF-8"))
        return _http_problem(error)

    @app.exception_handler(Exception)
    async def on_unexpected(request: Request, error: Exception) -> Response:
        errors.log_unexpected(log, error, request.url.path)
        return problem_response(error)


def _refusal(request: Request, error: RequestValidationError) -> InvalidArgument:
    """The error for FastAPI's findings in a request."""
    first = error.errors()[0]
    if first["type"] == "json_invalid":
        place = f"{first['ctx']['error']}, at character {first['loc'][-1]}"
        return InvalidArgument(f"the body is not JSON: {place}")
    for whole in (each for each in error.errors() if each["loc"] == ("body",)):
        if whole["type"] == "missing":
            return InvalidArgument("a JSON body is needed; send content-type: application/json")
        if isinstance(whole["input"], bytes):  # not parsed as JSON
            came = request.headers.get("content-type", "none")[:64]
            return InvalidArgument(f"send content-type: application/json, not {came}")
        if whole["type"] == "model_attributes_type":
            return InvalidArgument(f"the body {sentence(whole)}")
    # loc starts with the part of the request: body, query, path
    found = [{**each, "loc": each["loc"][1:]} for each in error.errors()]
    body = request.scope["route"].body_field
    return refusal(found, kind=body and body.field_info.annotation)


def problem_response(error: BaseException) -> Response:
    """The answer to a request that raised."""
    response = _problem(errors.to_problem(error))
    response.headers.update(errors.headers_of(error))
    return response


def _http_problem(error: HTTPException) -> Response:
    """Failures of HTTP itself: unknown route, method not allowed, body too large."""
    response = _problem(errors.http_problem(error.status_code, str(error.detail)))
    response.headers.update(error.headers or {})
    return response


def _problem(problem: dict[str, Any]) -> Response:
    return Response(
        json.dumps(problem), status_code=problem["status"], media_type=errors.PROBLEM_JSON
    )
