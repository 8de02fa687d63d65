"""The session, scene or agent of a call, over gRPC and HTTP: its node takes the call."""

import json
from collections.abc import Mapping
from typing import Any, Final, Literal
from urllib.parse import parse_qs

from google.protobuf.message import DecodeError
from starlette.routing import compile_path

from wayfarer.runtime.persistence.snapshot import named_session
from wayfarer.transport.contract import CALLS, Rpc
from wayfarer.transport.edge.request_limits import MESHES
from wayfarer.v1.options_pb2 import CallOptions

NAMES: Final = ("scene_id", "session_id", "agent_id")

Subject = tuple[Literal["new", "named", "any"], str]
"""("new", its request id), ("named", an id), or ("any", ""): one node does as well as another."""

ANY_NODE: Final[Subject] = ("any", "")

METHODS: Final[Mapping[str, Rpc]] = {call.path: call for call in CALLS.values()}
"""All RPCs, by path of gRPC."""


def is_for_all(call: Rpc | None) -> bool:
    """Every node is asked (every_node.py)."""
    return call is not None and call.options.routing == CallOptions.ROUTING_ALL


def grpc_subject(call: Rpc, data: bytes) -> Subject:
    """The subject of a call, from its first message; any node refuses an unreadable message."""
    try:
        message: Any = call.request.FromString(data)
    except DecodeError:
        return ANY_NODE
    match call.options.routing:
        case CallOptions.ROUTING_NEW:
            if message.DESCRIPTOR.name == "CreateSessionRequest" and message.scene:
                return "named", message.scene
            own = "request_id" in message.DESCRIPTOR.fields_by_name
            return "new", message.request_id if own else message.header.scene.request_id
        case CallOptions.ROUTING_IMPORT:
            return "named", named_session(message.snapshot)
    if "open" in message.DESCRIPTOR.fields_by_name:  # Control
        message = message.open
    names = [getattr(message, name) for name in NAMES if name in message.DESCRIPTOR.fields_by_name]
    return ("named", str(names[0])) if names else ANY_NODE


_ROUTES: Final = [
    (call.route[0], compile_path(call.route[1])[0], call)
    for call in CALLS.values()
    if call.options.route
]


def http_call(method: str, path: str) -> tuple[Rpc | None, str]:
    """The RPC of an HTTP request, and the scene, session or agent in its path, or an empty text."""
    for verb, expression, call in _ROUTES:
        if verb == method and (found := expression.match(path)):
            parts = found.groupdict()
            return call, next((parts[name] for name in NAMES if name in parts), "")
    return None, ""


def http_is_for_all(method: str, path: str) -> bool:
    """Every node is asked; `/v1/stats` is each node's own."""
    return (method, path) == ("GET", "/v1/stats") or is_for_all(http_call(method, path)[0])


def http_subject(method: str, path: str, query: str, key: str, body: bytes) -> Subject:
    """The route of a request that is not for all nodes; `key`: its Idempotency-Key."""
    if path == "/v1/events":
        return "named", session_of(query)
    call, name = http_call(method, path)
    match call.options.routing if call else None:
        case CallOptions.ROUTING_NEW:
            if path == MESHES:
                return "new", parse_qs(query).get("request_id", [""])[0] or key
            request = _json(body)
            if path == "/v1/sessions" and (scene := _text(request, "scene")):
                return "named", scene
            return "new", _text(request, "request_id") or key
        case CallOptions.ROUTING_IMPORT:
            return "named", named_session(body)
    return ("named", name) if name else ANY_NODE


def session_of(query: str) -> str:
    """The session that a stream's query names; empty for none."""
    return parse_qs(query).get("session", [""])[0]


def _json(body: bytes) -> Any:
    try:
        return json.loads(body or b"{}")
    except ValueError:  # to be refused by the node
        return {}


def _text(request: Any, name: str) -> str:
    found = request.get(name, "") if isinstance(request, dict) else ""
    return found if isinstance(found, str) else ""
