"""HTTP connections as uvicorn sees them, with what it lacks: an end to slow requests, a bound on
their number, and the name in the client's certificate.
"""

import asyncio
from typing import Any, Final

import h11
from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

REQUEST_S: Final = 20.0
"""A whole request must have come in within so long of its first byte, or of the connection."""

UNREADABLE: Final = b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"

CERTIFICATE: Final = "certificate"
"""Key of the scope's `state`: common name of the client's verified certificate."""


class HttpConnection(H11Protocol):
    """One connection. `limit_concurrency` of uvicorn bounds their number, idle ones too."""

    request_s = REQUEST_S

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Refuse, without a word, what is beyond the limit."""
        super().connection_made(transport)
        self.app = _named(self.app, transport)
        if self.limit_concurrency is not None and len(self.connections) > self.limit_concurrency:
            transport.abort()
            return
        self._watch(h11.IDLE)

    def data_received(self, data: bytes) -> None:
        """Take a piece of a request."""
        super().data_received(data)
        self._watch(h11.IDLE, h11.SEND_BODY)

    def on_response_complete(self) -> None:
        """The next request may be here already, in part."""
        super().on_response_complete()
        self._watch(h11.SEND_BODY)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the deadline."""
        self._stop_watch()
        super().connection_lost(exc)

    def _watch(self, *receiving: Any) -> None:
        """Keep the deadline while a request is coming in."""
        upgraded = self.transport.get_protocol() is not self
        if upgraded or self.transport.is_closing() or self.conn.their_state not in receiving:
            self._stop_watch()
        elif self._deadline is None:
            self._deadline = self.loop.call_later(self.request_s, self.transport.abort)

    def _stop_watch(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None


class SocketConnection(WebSocketsSansIOProtocol):
    """A connection that has become a WebSocket."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Note who is at the other end."""
        super().connection_made(transport)
        self.app = _named(self.app, transport)

    def data_received(self, data: bytes) -> None:
        """Take a piece. Of a handshake that cannot be read, uvicorn would say nothing for ever."""
        super().data_received(data)
        if self.conn.handshake_exc is not None and not self.handshake_initiated:
            self.transport.write(UNREADABLE)
            self.transport.close()

    def send_receive_event_to_app(self) -> None:
        """Hand a message on. A text that is not UTF-8 ends the connection; uvicorn would fail."""
        if self.curr_msg_data_type == "text" and not _is_text(b"".join(self.frames)):
            self.frames = []
            self.transport.abort()
            return
        super().send_receive_event_to_app()


def _is_text(data: bytes) -> bool:
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True


def _named(app: Any, transport: asyncio.BaseTransport) -> ASGIApp:
    """The application, told the common name in the client's certificate."""
    name = common_name(transport.get_extra_info("peercert"))
    if not name:
        return app

    async def named(scope: Scope, receive: Receive, send: Send) -> None:
        scope["state"][CERTIFICATE] = name
        await app(scope, receive, send)

    return named


def common_name(certificate: dict[str, Any] | None) -> str:
    """Of a certificate as `ssl.SSLSocket.getpeercert` gives it; empty when there is none."""
    for part in (certificate or {}).get("subject", ()):
        for key, value in part:
            if key == "commonName":
                return str(value)
    return ""
