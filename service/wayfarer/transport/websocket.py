"""`WS /v1/stream` and `WS /v1/control`: messages of StreamMotion and Control in binary frames.

Closed with 1000 when the session ends, else with 4000 + the HTTP status of the error and its text
as the reason (errors.py).
"""

import asyncio
import contextlib
from collections.abc import AsyncGenerator
from contextlib import aclosing
from typing import Any, Final

import structlog
from fastapi import FastAPI, WebSocket, WebSocketDisconnect
from google.protobuf.message import DecodeError
from pydantic import ValidationError
from starlette.datastructures import QueryParams

from wayfarer.errors import InvalidArgument
from wayfarer.transport import errors, schema
from wayfarer.transport.control import control
from wayfarer.transport.gateway import Gateway
from wayfarer.v1 import control_pb2

log = structlog.get_logger(__name__)

STALL_S: Final = 30.0
"""Seconds after which a reader that takes nothing is disconnected. It may resume."""

REASON_BYTES: Final = 123
"""RFC 6455, 5.5: a control frame has 125 bytes, two of them the code."""

PARAMETERS: Final = (
    *("session", "agent", "encoding", "profile", "bones", "fps", "slow_reader", "resume_token"),
)


def add_sockets(app: FastAPI, gateway: Gateway) -> None:
    """Add the routes."""

    @app.websocket("/v1/stream")
    async def stream(socket: WebSocket) -> None:
        await socket.accept()
        sending = asyncio.create_task(_send_stream(socket, gateway))
        leaving = asyncio.create_task(_until_gone(socket))
        try:
            await asyncio.wait({sending, leaving}, return_when=asyncio.FIRST_COMPLETED)
            if sending.done():
                await _close(socket, sending.exception())
        finally:
            sending.cancel()
            leaving.cancel()
            await asyncio.wait({sending, leaving})

    @app.websocket("/v1/control")
    async def controlled(socket: WebSocket) -> None:
        await socket.accept()
        requests = _requests(socket)
        try:
            async with aclosing(requests):
                await _send(socket, control(gateway, requests))
        except Exception as error:
            await _close(socket, error)
        else:
            await _close(socket, None)


def stream_request(query: QueryParams) -> schema.StreamRequest:
    """What the query asks for; names as in StreamMotionRequest, lists by repetition.

    Raises InvalidArgument.
    """
    if unknown := [name[:32] for name in query if name not in PARAMETERS]:
        raise InvalidArgument(f"unknown; there are {', '.join(PARAMETERS)}", unknown[0])
    packed: dict[str, Any] = {k: query[k] for k in ("encoding", "profile") if k in query}
    packed["bones"] = query.getlist("bones")
    fps = query.get("fps", "0")
    if not (fps.isascii() and fps.isdigit() and len(fps) < 4):
        raise InvalidArgument("must be 40, 20 or 10", "fps")
    packed["fps"] = int(fps)
    options = {k: query[k] for k in ("slow_reader", "resume_token") if k in query}
    try:
        return schema.StreamRequest(
            session_id=query.get("session", ""),
            agent_ids=tuple(query.getlist("agent")),
            format=schema.PoseFormat(**packed),
            **options,  # type: ignore[arg-type]
        )
    except ValidationError as error:
        raise errors.invalid_request(error) from None


async def _send_stream(socket: WebSocket, gateway: Gateway) -> None:
    await _send(socket, gateway.motion.stream(stream_request(socket.query_params)))


async def _send(socket: WebSocket, messages: AsyncGenerator[bytes]) -> None:
    """Send until there are no more. Raises TimeoutError when the reader takes none."""
    async with aclosing(messages):
        async for message in messages:
            try:
                async with asyncio.timeout(STALL_S):
                    await socket.send_bytes(message)
            except RuntimeError:  # uvicorn has closed it by itself meanwhile
                raise WebSocketDisconnect(1006) from None


async def _until_gone(socket: WebSocket) -> None:
    """Read, and ignore, what the client sends until it leaves."""
    while (await socket.receive())["type"] != "websocket.disconnect":
        pass


async def _requests(socket: WebSocket) -> AsyncGenerator[control_pb2.ControlRequest]:
    """What the client sends. Raises InvalidArgument, WebSocketDisconnect."""
    while True:
        message = await socket.receive()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message.get("code", 1006))
        try:
            yield control_pb2.ControlRequest.FromString(message.get("bytes") or b"")
        except DecodeError:
            raise InvalidArgument("a frame must be binary and hold one ControlRequest") from None


async def _close(socket: WebSocket, error: BaseException | None) -> None:
    """Tell the client why the stream is over."""
    if isinstance(error, WebSocketDisconnect | TimeoutError):
        log.info("stream reader gone or stalled", error=type(error).__name__)
        return
    code, reason = 1000, "the session has ended"
    if error is not None:
        errors.log_unexpected(log, error, socket.url.path)
        code = errors.close_code(error)
        reason = errors.message_of(error).encode()[:REASON_BYTES].decode(errors="ignore")
    # It has left at the same moment; a RuntimeError when uvicorn has answered its close, or broken
    # frames, by itself.
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        await socket.close(code, reason)
