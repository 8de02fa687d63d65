"""Methods of a server that can be called on any node of its cluster."""

from collections.abc import Callable
from typing import Any, Final

import grpc

from wayfarer_client.homes import slot_of

NAMES: Final = ("session_id", "agent_id", "scene_id", "scene")
"""Fields of requests that name the session, scene or agent that a call is about."""


class Method:
    """A stub's method of a service, not bound to a channel."""

    def __init__(self, kind: str, path: str, serializers: dict[str, Callable[..., Any]]) -> None:
        self._kind, self._path, self._serializers = kind, path, serializers

    def on(self, channel: grpc.aio.Channel) -> Any:
        """The method bound to a channel."""
        return getattr(channel, self._kind)(self._path, **self._serializers)


class Methods:
    """Stands in for the channel of generated stubs, and gives them `Method`s."""

    def unary_unary(self, path: str, **serializers: Any) -> Method:
        """One request, one reply."""
        return _method("unary_unary", path, serializers)

    def unary_stream(self, path: str, **serializers: Any) -> Method:
        """One request, many replies."""
        return _method("unary_stream", path, serializers)

    def stream_unary(self, path: str, **serializers: Any) -> Method:
        """Many requests, one reply."""
        return _method("stream_unary", path, serializers)

    def stream_stream(self, path: str, **serializers: Any) -> Method:
        """Many of both."""
        return _method("stream_stream", path, serializers)


def _method(kind: str, path: str, serializers: dict[str, Any]) -> Method:
    serializers.pop("_registered_method", None)  # of synchronous channels
    return Method(kind, path, serializers)


def about(request: Any) -> str:
    """The id that a request names; the request itself if it is an id; or ""."""
    if isinstance(request, str):
        return request
    names = (getattr(request, name, "") for name in NAMES)
    return next((name for name in names if isinstance(name, str) and slot_of(name)), "")


def made(reply: Any) -> str:
    """The id of the session or scene in a reply, or ""."""
    return about(getattr(reply, "session", "")) or about(getattr(reply, "scene", ""))
