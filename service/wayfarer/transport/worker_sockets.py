"""The door of a worker through which the front of its server comes: two Unix sockets.

Only the front can reach them: their folder is the server's own user's alone. What it relays comes
without TLS, and with the address of the caller and the name in its certificate in headers, which
are believed here and nowhere else.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import quote, unquote

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from wayfarer.transport.connection import CERTIFICATE

PREFIX: Final = "x-wayfarer-"
"""Prefix of headers that only the front may set; it removes them from clients' requests."""

_ADDRESS: Final = PREFIX + "address"
_CERTIFICATE: Final = PREFIX + "certificate"


@dataclass(frozen=True, slots=True)
class WorkerSockets:
    """Where the sockets are."""

    folder: Path

    @property
    def grpc(self) -> Path:
        """Socket of gRPC."""
        return self.folder / "grpc"

    @property
    def http(self) -> Path:
        """Socket of HTTP and WebSocket."""
        return self.folder / "http"

    def clear(self) -> None:
        """Remove what a process that was killed has left."""
        self.grpc.unlink(missing_ok=True)
        self.http.unlink(missing_ok=True)


@dataclass(frozen=True, slots=True)
class ClientOrigin:
    """The client for which the front relays."""

    address: str  # without port
    certificate: str = ""  # common name of a verified client certificate

    @classmethod
    def read(cls, headers: Mapping[str, str]) -> "ClientOrigin":
        """Read it from the headers that the front sets."""
        return cls(unquote(headers.get(_ADDRESS, "")), unquote(headers.get(_CERTIFICATE, "")))

    def headers(self) -> dict[str, str]:
        """The headers that carry it."""
        return {_ADDRESS: quote(self.address), _CERTIFICATE: quote(self.certificate)}


class TrustedRelay:
    """ASGI middleware of the inner socket: the caller is who the front says it is."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request or socket."""
        if scope["type"] in ("http", "websocket"):
            origin = ClientOrigin.read(Headers(scope=scope))
            scope["client"] = (origin.address, 0)
            if origin.certificate:
                scope.setdefault("state", {})[CERTIFICATE] = origin.certificate
        await self._app(scope, receive, send)
