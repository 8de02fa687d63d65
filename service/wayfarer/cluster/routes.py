"""What a call is about, over gRPC and over HTTP alike: so it goes to the node that has that."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any, Final, Literal
from urllib.parse import parse_qs

from google.protobuf.message import DecodeError, Message
from google.protobuf.message_factory import GetMessageClass

from wayfarer.service.persistence.snapshot import named_session
from wayfarer.transport.grpc_server import FILES
from wayfarer.transport.request_limits import MESHES

NAMES: Final = ("scene_id", "session_id", "agent_id")

Subject = tuple[Literal["new", "named", "any"], str]
"""("new", its request id), ("named", an id), or ("any", ""): one node does as well as another."""

ANY_NODE: Final[Subject] = ("any", "")


class RouteKind(Enum):
    """What decides."""

    NEW = auto()  # a scene or a session is made: placement chooses, unless a scene is named
    NAMED = auto()  # the scene, session or agent that it names
    IMPORT = auto()  # the session in the snapshot that it brings
    ALL = auto()  # every node is asked (every_node.py)
    ANY = auto()  # one node does as well as another


ALL: Final = ("ListSessions", "ListScenes", "LoadModel", "UseModel", "UnloadModel", "Drain")
NEW: Final = ("CreateSession", "CreateScene", "CreateMeshScene", "CreateExampleScene")


@dataclass(frozen=True, slots=True)
class RoutedMethod:
    """A gRPC method."""

    path: str  # /package.Service/Method
    kind: RouteKind
    request: type[Message]
    reply: type[Message]

    def subject(self, data: bytes) -> Subject:
        """Of the call that begins with this message; what cannot be read is refused anywhere."""
        if self.kind is RouteKind.ANY:
            return ANY_NODE
        try:
            message: Any = self.request.FromString(data)
        except DecodeError:
            return ANY_NODE
        if self.kind is RouteKind.NEW:
            if scene := _scene_in(message):
                return "named", scene
            return "new", _request_id_in(message)
        if self.kind is RouteKind.IMPORT:
            return "named", named_session(message.snapshot)
        return "named", _name_in(message)


def _name_in(message: Any) -> str:
    """The id of the scene, session or agent that a request is about."""
    fields = message.DESCRIPTOR.fields_by_name
    if "open" in fields:  # Control
        message, fields = message.open, message.open.DESCRIPTOR.fields_by_name
    return next(str(getattr(message, name)) for name in NAMES if name in fields)


def _scene_in(message: Any) -> str:
    """The scene in which a session is to be."""
    return str(message.scene) if message.DESCRIPTOR.name == "CreateSessionRequest" else ""


def _request_id_in(message: Any) -> str:
    fields = message.DESCRIPTOR.fields_by_name
    return str(message.request_id if "request_id" in fields else message.header.scene.request_id)


def _kind(name: str, request: Any) -> RouteKind:
    if name in ALL:
        return RouteKind.ALL
    if name in NEW:
        return RouteKind.NEW
    if name == "ImportSession":
        return RouteKind.IMPORT
    named = {*NAMES, "open"} & set(request.fields_by_name)
    return RouteKind.NAMED if named else RouteKind.ANY


METHODS: Final[Mapping[str, RoutedMethod]] = {
    method.path: method
    for file in FILES
    for service in file.DESCRIPTOR.services_by_name.values()
    for found in service.methods
    for method in [
        RoutedMethod(
            f"/{service.full_name}/{found.name}",
            _kind(found.name, found.input_type),
            GetMessageClass(found.input_type),
            GetMessageClass(found.output_type),
        )
    ]
}
"""All of ours, by path."""


_NAMED: Final = re.compile(r"/v1/(?:sessions|agents|scenes)/([^/]+)")
_MADE: Final = re.compile(r"/v1/(?:sessions|scenes|scenes/mesh|scenes/examples/[^/]+)")
"""Where a session or a scene is made."""
_ADMIN: Final = re.compile(r"/v1/admin/[^/]+")


def http_kind(method: str, path: str) -> RouteKind:
    """The kind of an HTTP request."""
    if method == "POST" and _MADE.fullmatch(path):
        return RouteKind.NEW
    if path.startswith("/v1/scenes/examples"):
        return RouteKind.ANY
    if _NAMED.match(path) or path == "/v1/events":
        return RouteKind.NAMED
    if (method, path) == ("POST", "/v1/snapshots"):
        return RouteKind.IMPORT
    if method == "GET" and path in ("/v1/sessions", "/v1/scenes", "/v1/stats"):
        return RouteKind.ALL
    if method in ("POST", "DELETE") and _ADMIN.match(path):
        return RouteKind.ALL
    return RouteKind.ANY


def http_subject(method: str, path: str, query: str, key: str, body: bytes) -> Subject:
    """Of a request that is not for all; `key`: its Idempotency-Key."""
    kind = http_kind(method, path)
    if kind is RouteKind.NEW:
        if path == MESHES:
            return "new", parse_qs(query).get("request_id", [""])[0] or key
        request = _json(body)
        if path == "/v1/sessions" and (scene := _text(request, "scene")):
            return "named", scene
        return "new", _text(request, "request_id") or key
    if kind is RouteKind.IMPORT:
        return "named", named_session(body)
    if kind is RouteKind.NAMED:
        found = _NAMED.match(path)
        return "named", found[1] if found else session_of(query)
    return ANY_NODE


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
