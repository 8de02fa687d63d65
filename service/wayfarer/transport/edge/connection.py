"""HTTP connections of uvicorn with three additions: a timeout for slow requests, limits on their
number and their heads, and the name in the client's certificate.
"""

import asyncio
import json
from http import HTTPStatus
from typing import Any, Final

import h11
from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from wayfarer.transport.errors import http_problem

REQUEST_S: Final = 20.0
"""Seconds within which a whole request must arrive, from its first byte or from connecting."""

HEAD_BYTES: Final = 32 * 1024
"""Maximum bytes of the head of a request: its first line and its headers."""

NO_TEXT: Final = 1007
"""WebSocket close code of a text that is not UTF-8 (RFC 6455, 8.1)."""

SEPARATORS: Final = len(b": \r\n")
"""Approximate bytes that each line of the head adds."""

CERTIFICATE: Final = "certificate"
"""Key of the scope's `state`: common name of the client's verified certificate."""


class StrictParser(h11.Connection):
    """h11's parser bounds only heads that come in pieces, and accepts two lengths of a body; this
    one refuses both.
    """

    def __init__(self) -> None:
        super().__init__(h11.SERVER, HEAD_BYTES)
        self.refusal = refusal(HTTPStatus.BAD_REQUEST, "the request cannot be read")

    def next_event(self) -> Any:
        """Like h11's. If it raises RemoteProtocolError, `refusal` answers the request."""
        try:
            event = super().next_event()
            if isinstance(event, h11.Request):
                _check_head(event)
        except h11.RemoteProtocolError as error:
            self.refusal = refusal(error.error_status_hint, str(error))
            raise
        return event


def _check_head(request: h11.Request) -> None:
    """Raises RemoteProtocolError."""
    headers = list(request.headers)
    size = len(request.method) + len(request.target) + sum(len(n) + len(v) for n, v in headers)
    if size + SEPARATORS * (len(headers) + 1) > HEAD_BYTES:
        raise h11.RemoteProtocolError(
            f"the head of a request has {HEAD_BYTES} bytes at most", error_status_hint=431
        )
    if {b"content-length", b"transfer-encoding"} <= {name for name, _ in headers}:
        # a proxy in front may use the other one, and see the beginning of another request
        raise h11.RemoteProtocolError("Content-Length or Transfer-Encoding, not both")


def refusal(status: int, detail: str) -> bytes:
    """The answer to a request that is not read further."""
    phrase = HTTPStatus(status).phrase
    body = json.dumps(http_problem(status, detail)).encode()
    head = (
        f"HTTP/1.1 {int(status)} {phrase}\r\nConnection: close\r\nContent-Length: {len(body)}\r\n"
        "Content-Type: application/problem+json\r\nX-Content-Type-Options: nosniff\r\n\r\n"
    )
    return head.encode() + body


class HttpConnection(H11Protocol):
    """One connection. uvicorn's `limit_concurrency` limits their number, including idle ones."""

    request_s = REQUEST_S

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.conn: StrictParser = StrictParser()
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Closes connections beyond the limit without an answer."""
        super().connection_made(transport)
        self.app = _named(self.app, transport)
        if self.limit_concurrency is not None and len(self.connections) > self.limit_concurrency:
            transport.abort()
            return
        self._watch(h11.IDLE)

    def data_received(self, data: bytes) -> None:
        """Takes a piece of a request."""
        super().data_received(data)
        self._watch(h11.IDLE, h11.SEND_BODY)

    def on_response_complete(self) -> None:
        """Watches the next request, part of which may have arrived already."""
        super().on_response_complete()
        self._watch(h11.SEND_BODY)

    def send_400_response(self, msg: str) -> None:
        """Answers a request that is not read further with its error, and hangs up."""
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            self.transport.write(self.conn.refusal)
        self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forgets the deadline."""
        self._stop_watch()
        super().connection_lost(exc)

    def _watch(self, *receiving: Any) -> None:
        """Keeps the deadline while a request is arriving."""
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
        """Notes the name in the client's certificate."""
        super().connection_made(transport)
        self.app = _named(self.app, transport)

    def data_received(self, data: bytes) -> None:
        """Takes a piece. uvicorn would never answer a handshake that cannot be parsed."""
        super().data_received(data)
        if self.conn.handshake_exc is not None and not self.handshake_initiated:
            self.transport.write(
                refusal(HTTPStatus.BAD_REQUEST, "the WebSocket handshake cannot be read")
            )
            self.transport.close()

    def send_receive_event_to_app(self) -> None:
        """Passes a message to the application. Text that is not UTF-8 ends the connection."""
        if self.curr_msg_data_type == "text" and not _is_text(b"".join(self.frames)):
            self.frames = []
            if not self.close_sent:
                self.conn.fail(NO_TEXT, "a text frame must be UTF-8")
                self.handle_parser_exception()
            return
        super().send_receive_event_to_app()


def _is_text(data: bytes) -> bool:
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True


def _named(app: Any, transport: asyncio.BaseTransport) -> ASGIApp:
    """Wraps the application so that its scope has the common name of the client's certificate."""
    name = common_name(transport.get_extra_info("peercert"))
    if not name:
        return app

    async def named(scope: Scope, receive: Receive, send: Send) -> None:
        scope["state"][CERTIFICATE] = name
        await app(scope, receive, send)

    return named


def common_name(certificate: dict[str, Any] | None) -> str:
    """Common name in a certificate from `ssl.SSLSocket.getpeercert`; empty if it has none."""
    for part in (certificate or {}).get("subject", ()):
        for key, value in part:
            if key == "commonName":
                return str(value)
    return ""
