"""`WS /v1/stream` and `WS /v1/control`: messages of StreamMotion and Control in binary frames.

Closes with 1000 when the session ends, or with 4000 + the error's HTTP status and its text as the
reason (errors.py).
"""

import asyncio
import contextlib
from collections.abc import AsyncGenerator, Iterator
from contextlib import aclosing, contextmanager
from typing import Any, Final, TypeVar

import structlog
from fastapi import FastAPI, WebSocket, WebSocketDisconnect
from google.protobuf.message import DecodeError
from pydantic import BaseModel, ValidationError
from starlette.datastructures import QueryParams

from wayfarer.errors import InvalidArgument, unknown_name
from wayfarer.transport import errors, schema
from wayfarer.transport.conversion.violations import invalid_request, renamed
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.streams.control import control
from wayfarer.transport.streams.stream import MotionStream
from wayfarer.v1 import control_pb2

log = structlog.get_logger(__name__)

STALL_S: Final = 30.0
"""Seconds after which a reader that accepts nothing is disconnected. It may resume."""

VIEWPOINTS_PER_S: Final = 20
"""Maximum rate at which viewpoints are moved, per second; the last ones count."""

JSON_LENGTH: Final = 8_000
"""Maximum characters of rings or viewpoints."""

Kind = TypeVar("Kind", bound=BaseModel)

PARAMETERS: Final = (
    *("session", "agent", "encoding", "profile", "bones", "fps", "slow_reader", "resume_token"),
    *("interest", "max_message_bytes"),
)


def add_sockets(app: FastAPI, gateway: Gateway) -> None:
    """Adds the routes."""

    @app.websocket("/v1/stream")
    async def stream(socket: WebSocket) -> None:
        await socket.accept()
        viewpoints = LatestText()
        sending = asyncio.create_task(_send_stream(socket, gateway, viewpoints))
        leaving = asyncio.create_task(_until_gone(socket, viewpoints))
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
    """The request in the query; names as in StreamMotionRequest, lists by repetition.

    Raises InvalidArgument.
    """
    if unknown := [name[:32] for name in query if name not in PARAMETERS]:
        raise InvalidArgument(unknown_name(unknown[0], PARAMETERS), unknown[0])
    packed: dict[str, Any] = {k: query[k] for k in ("encoding", "profile") if k in query}
    packed["bones"] = query.getlist("bones")
    fps = query.get("fps", "0")
    if not (fps.isascii() and fps.isdigit() and len(fps) < 4):
        raise InvalidArgument("must be 40, 20 or 10", "fps")
    packed["fps"] = int(fps)
    options: dict[str, Any] = {k: query[k] for k in ("slow_reader", "resume_token") if k in query}
    most = query.get("max_message_bytes", "0")
    if not (most.isascii() and most.isdigit() and len(most) < 10):
        raise InvalidArgument("must be a number of bytes", "max_message_bytes")
    options["max_message_bytes"] = int(most)
    if "interest" in query:
        options["interest"] = _from_json(schema.Interest, query["interest"], "interest")
    try:
        return schema.StreamRequest(
            session_id=query.get("session", ""),
            agent_ids=tuple(query.getlist("agent")),
            format=schema.PoseFormat(**packed),
            **options,
        )
    except ValidationError as error:
        raise invalid_request(error) from None


@contextmanager
def _query_names() -> Iterator[None]:
    """Names fields of StreamMotionRequest as the query does."""
    try:
        yield
    except InvalidArgument as error:
        field = error.field.removeprefix("format.")
        field = field.replace("session_id", "session").replace("agent_ids", "agent")
        raise renamed(error, field) from None


class LatestText:
    """Holds the last text that came; earlier ones are never parsed, so that a flood costs little
    and delays nothing.
    """

    def __init__(self) -> None:
        self._text = ""
        self._came = asyncio.Event()

    def put(self, text: str) -> None:
        """Stores a text."""
        self._text = text
        self._came.set()

    async def next(self) -> str:
        """Returns the last text, once there is a new one."""
        await self._came.wait()
        self._came.clear()
        return self._text


async def _send_stream(socket: WebSocket, gateway: Gateway, texts: LatestText) -> None:
    with _query_names():
        await _send_asked(socket, gateway, texts)


async def _send_asked(socket: WebSocket, gateway: Gateway, texts: LatestText) -> None:
    request = stream_request(socket.query_params)
    async with gateway.motion.follow(request) as (stream, messages):
        if request.interest is None:
            await _send(socket, messages)
            return
        both = [
            asyncio.create_task(_send(socket, messages)),
            asyncio.create_task(_look(stream, texts)),
        ]
        try:
            done, _ = await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in both:
                task.cancel()
            await asyncio.gather(*both, return_exceptions=True)


async def _look(stream: MotionStream, texts: LatestText) -> None:
    """Moves the viewpoints as the client asks, at most `VIEWPOINTS_PER_S` times per second.

    Raises InvalidArgument.
    """
    while True:
        stream.look(_from_json(schema.Viewpoints, await texts.next(), ""))
        await asyncio.sleep(1 / VIEWPOINTS_PER_S)


def _from_json(kind: type[Kind], text: str, field: str) -> Kind:
    """Raises InvalidArgument."""
    if len(text) > JSON_LENGTH:
        raise InvalidArgument(f"has {len(text)} characters; allowed: {JSON_LENGTH}", field)
    try:
        return kind.model_validate_json(text)
    except ValidationError as error:
        raise invalid_request(error, field, kind) from None


async def _send(socket: WebSocket, messages: AsyncGenerator[bytes]) -> None:
    """Sends all messages. Raises TimeoutError if the reader accepts none."""
    async with aclosing(messages):
        async for message in messages:
            try:
                async with asyncio.timeout(STALL_S):
                    await socket.send_bytes(message)
            except RuntimeError:  # uvicorn has closed it meanwhile
                raise WebSocketDisconnect(1006) from None


async def _until_gone(socket: WebSocket, texts: LatestText) -> None:
    """Keeps the client's last text, and ignores other frames, until it leaves."""
    while (message := await socket.receive())["type"] != "websocket.disconnect":
        if text := message.get("text"):
            texts.put(text)


async def _requests(socket: WebSocket) -> AsyncGenerator[control_pb2.ControlRequest]:
    """The client's messages. Raises InvalidArgument, WebSocketDisconnect."""
    while True:
        message = await socket.receive()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message.get("code", 1006))
        try:
            yield control_pb2.ControlRequest.FromString(message.get("bytes") or b"")
        except DecodeError:
            raise InvalidArgument("a frame must be binary and hold one ControlRequest") from None


async def _close(socket: WebSocket, error: BaseException | None) -> None:
    """Sends the client the reason why the stream ended."""
    if isinstance(error, WebSocketDisconnect | TimeoutError):
        log.info("stream reader gone or stalled", error=type(error).__name__)
        return
    code, reason = 1000, "the session has ended"
    if error is not None:
        errors.log_unexpected(log, error, socket.url.path)
        code, reason = errors.close_code(error), errors.close_reason(error)
    # The client left at the same moment. RuntimeError: uvicorn has answered its close, or broken
    # frames, by itself.
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        await socket.close(code, reason)
