"""`WS /v1/stream`: the messages of StreamMotion, one protobuf per binary frame.

Closed with 1000 when the session ends, 1008 when the origin is foreign, else with 4000 + the HTTP
status of the error and its text as the reason (errors.py).
"""

import asyncio
from contextlib import aclosing
from ipaddress import ip_address
from typing import Annotated, Final
from urllib.parse import urlsplit

import structlog
from fastapi import FastAPI, Query, WebSocket, WebSocketDisconnect

from wayfarer.transport import errors
from wayfarer.transport.gateway import ID_LENGTH, Gateway

log = structlog.get_logger(__name__)

SEND_TIMEOUT_S: Final = 2.0
POLICY_VIOLATION: Final = 1008
REASON_BYTES: Final = 123
"""RFC 6455, 5.5: a control frame has 125 bytes, two of them the code."""

Id = Annotated[str, Query(max_length=ID_LENGTH)]


def add_stream(app: FastAPI, gateway: Gateway) -> None:
    """Add the route."""

    @app.websocket("/v1/stream")
    async def stream(
        socket: WebSocket, session: Id, agent: Annotated[list[Id] | None, Query()] = None
    ) -> None:
        if not is_allowed_origin(socket.headers.get("origin"), socket.headers.get("host", "")):
            await socket.close(POLICY_VIOLATION)
            return
        await socket.accept()
        sending = asyncio.create_task(_send(socket, gateway, session, agent or []))
        leaving = asyncio.create_task(_until_gone(socket))
        try:
            await asyncio.wait({sending, leaving}, return_when=asyncio.FIRST_COMPLETED)
            if sending.done():
                await _close(socket, sending)
        finally:
            sending.cancel()
            leaving.cancel()
            await asyncio.wait({sending, leaving})


def is_allowed_origin(origin: str | None, host: str) -> bool:
    """Whether a page of `origin` may read the stream: our own pages, and those of this machine.

    Other programs send no origin and are not a browser's to protect.
    """
    if origin is None:
        return True
    try:
        parts = urlsplit(origin)
        if parts.netloc == host or parts.hostname == "localhost":
            return True
        return ip_address(parts.hostname or "").is_loopback
    except ValueError:  # neither a URL nor an address
        return False


async def _send(socket: WebSocket, gateway: Gateway, session: str, agents: list[str]) -> None:
    """Send messages until the session ends. A reader that takes none for 2 s is left."""
    async with aclosing(gateway.stream(session, agents)) as messages:
        async for message in messages:
            async with asyncio.timeout(SEND_TIMEOUT_S):
                await socket.send_bytes(message.SerializeToString())


async def _until_gone(socket: WebSocket) -> None:
    """Read, and ignore, what the client sends until it leaves."""
    while (await socket.receive())["type"] != "websocket.disconnect":
        pass


async def _close(socket: WebSocket, sending: asyncio.Task[None]) -> None:
    """Tell the client why the stream is over."""
    error = sending.exception()
    if isinstance(error, WebSocketDisconnect | TimeoutError):
        log.info("stream reader gone or stalled", error=type(error).__name__)
        return
    if error is None:
        await socket.close(1000, "the session has ended")
        return
    errors.log_unexpected(log, error, "/v1/stream")
    reason = errors.message_of(error).encode()[:REASON_BYTES].decode(errors="ignore")
    await socket.close(errors.close_code(error), reason)
