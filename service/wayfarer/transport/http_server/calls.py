"""Calls as routes: the protos define verb, path, status and descriptions (contract.py)."""

import inspect
import re
from collections.abc import Awaitable, Callable, Mapping
from contextlib import nullcontext
from typing import Annotated, Any, Final

from fastapi import APIRouter
from fastapi import Path as InPath

from wayfarer.transport import schema
from wayfarer.transport.contract import CALLS, Rpc, twin_of
from wayfarer.transport.http_server.parameters import (
    Expected,
    IdempotencyKey,
    fields_of,
    request_id,
)

Endpoint = Callable[..., Any]
Special = Mapping[str, tuple[Endpoint, dict[str, Any]]]
"""Endpoints of RPCs that HTTP carries in a special way, each with arguments for FastAPI."""

Id = Annotated[str, InPath(max_length=schema.ID_LENGTH)]
PLACEHOLDERS: Final[dict[str, Any]] = {
    "sessions": Annotated[Id, InPath(description="as given by createSession")],
    "agents": Annotated[Id, InPath(description="as given by createAgents")],
    "scenes": Annotated[Id, InPath(description="as given by createScene")],
    "examples": Annotated[Id, InPath(description="as in listExampleScenes")],
    "models": Annotated[Id, InPath(description="as in listModels")],
    "obstacles": Annotated[
        str, InPath(min_length=1, max_length=64, description="of the client's own making")
    ],
}
"""Types of the placeholders in paths, by the part of the path before them."""


def call_routes(methods: Mapping[str, Endpoint], special: Special) -> APIRouter:
    """Routes of these methods, by RPC; `special` has the endpoints of the others."""
    router = APIRouter()
    for name, call in CALLS.items():
        verb, path = call.route
        if not path or name not in {**methods, **special}:
            continue
        endpoint, more = special.get(name) or (_endpoint(call, methods[name]), {})
        router.add_api_route(
            path,
            endpoint,
            methods=[verb],
            status_code=call.status,
            operation_id=call.operation_id,
            summary=call.options.summary,
            description=call.options.description,
            tags=[call.tag],
            deprecated=call.deprecated or None,
            **more,
        )
    return router


def _endpoint(call: Rpc, method: Endpoint) -> Endpoint:
    """The method with its arguments from path, query and body."""
    signature = inspect.signature(method)
    parameters = [_in_http(call, parameter) for parameter in signature.parameters.values()]
    twin = next((p for p in signature.parameters.values() if twin_of(p)), None)
    if "request_id" in call.request.DESCRIPTOR.fields_by_name:
        parameters.append(_keyword("idempotency_key", IdempotencyKey, ""))

    async def carry_out(**given: Any) -> Any:
        key = given.pop("idempotency_key", "")
        if twin is not None:
            body = given[twin.name] or twin.annotation()
            if key:
                body = body.model_copy(update={"request_id": request_id(body.request_id, key)})
            given[twin.name] = body
        with fields_of(call.options.body) if call.options.body else nullcontext():
            found = method(**given)
            return await found if isinstance(found, Awaitable) else found

    carry_out.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return carry_out


def _in_http(call: Rpc, parameter: inspect.Parameter) -> inspect.Parameter:
    name, twin = parameter.name, twin_of(parameter)
    if twin is not None:
        optional = call.options.optional_body
        return _keyword(name, twin | None, None) if optional else _keyword(name, twin)
    if found := re.search(rf"(\w+)/{{{name}}}", call.options.route):
        return _keyword(name, PLACEHOLDERS[found[1]])
    return _keyword(name, {"expected_revision": Expected}[name], parameter.default)


def _keyword(name: str, kind: Any, default: Any = inspect.Parameter.empty) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=kind, default=default)
