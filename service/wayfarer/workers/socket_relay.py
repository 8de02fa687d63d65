"""WebSockets of the front: frames go to a worker and back."""

import asyncio
import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from google.protobuf.message import DecodeError
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState
from websockets.asyncio.client import ClientConnection, unix_connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Origin as OriginHeader
from websockets.typing import Subprotocol

from wayfarer.errors import Unavailable, WayfarerError
from wayfarer.transport import errors
from wayfarer.transport.http_guard import SUBPROTOCOL, check_page, presented
from wayfarer.transport.server_options import ServerOptions
from wayfarer.transport.websocket import STALL_S
from wayfarer.v1 import control_pb2
from wayfarer.workers.grpc_relay import FIRST_S
from wayfarer.workers.http_relay import relayed_headers
from wayfarer.workers.placement import Placement
from wayfarer.workers.routes import session_of

OPEN_S: Final = 5.0
"""Timeout of a connection to a worker on this machine."""

QUEUE: Final = 2
"""Frames that may wait here: what a slow reader leaves shall lie in the worker, which knows what to
do about it."""

LOST: Final = Unavailable("the worker was lost; try again")

CREDENTIALS: Final = ("authorization", "x-api-key", "x-request-id")


class SocketRelay:
    """One per front.

    Who calls is the workers' business, but a socket may be silent for long before anybody knows
    which worker that is: so pages and credentials are looked at here, too, at the handshake.
    """

    def __init__(
        self, sockets: Sequence[Path], placement: Placement, operation: ServerOptions
    ) -> None:
        """`sockets`: of the workers, in order."""
        self._sockets = sockets
        self._placement = placement
        self._operation = operation

    async def stream(self, socket: WebSocket) -> None:
        """`/v1/stream`: the query names the session."""
        try:
            await self._check(socket)
            worker = self._placement.find(session_of(socket.url.query))
            async with await self._open(worker, socket) as upstream:
                await socket.accept(upstream.subprotocol)
                await _pump(socket, upstream)
        except WayfarerError as error:
            await _refuse(socket, error)

    async def control(self, socket: WebSocket) -> None:
        """`/v1/control`: the first frame names the session."""
        try:
            await self._check(socket)
            await socket.accept(_offered(socket))
            async with asyncio.timeout(FIRST_S):
                first = await socket.receive()
            if first["type"] == "websocket.disconnect":
                return
            frame = first.get("bytes") or first.get("text") or b""
            worker = self._placement.find(_session_in(frame))
            async with await self._open(worker, socket) as upstream:
                with contextlib.suppress(ConnectionClosed):  # the pump says why
                    await upstream.send(frame)
                await _pump(socket, upstream)
        except TimeoutError:
            await _close(socket, 4422, f"nothing was opened within {FIRST_S:g} s")
        except WayfarerError as error:
            await _refuse(socket, error)

    async def _check(self, socket: WebSocket) -> None:
        """Raises PermissionDenied, Unauthenticated, ResourceExhausted, Unavailable."""
        scope = dict(socket.scope)  # what is presented is taken out; the worker shall see it, too
        check_page(scope, socket.headers, self._operation.origins)
        address = socket.client.host if socket.client else ""
        await self._operation.guard.authenticate(presented(scope, socket.headers), address)

    async def _open(self, worker: int, socket: WebSocket) -> ClientConnection:
        """Raises Unavailable."""
        headers = [(key, socket.headers[key]) for key in CREDENTIALS if key in socket.headers]
        told = [(key.decode(), value.decode()) for key, value in relayed_headers(socket.scope)]
        origin = socket.headers.get("origin")
        host = socket.headers.get("host", "worker")
        target = socket.url.path + ("?" + socket.url.query if socket.url.query else "")
        try:
            return await unix_connect(
                str(self._sockets[worker]),
                f"ws://{host}{target}",
                additional_headers=[*headers, *told],
                origin=OriginHeader(origin) if origin else None,
                subprotocols=[Subprotocol(name) for name in socket.scope["subprotocols"]] or None,
                user_agent_header=None,
                compression=None,
                max_size=None,  # the worker is trusted, and it bounds what comes up
                max_queue=QUEUE,
                ping_interval=None,
                open_timeout=OPEN_S,
                proxy=None,
            )
        except (OSError, InvalidHandshake, TimeoutError) as error:
            raise Unavailable(
                f"worker {worker} is being started again ({type(error).__name__}); try again"
            ) from None


async def _pump(socket: WebSocket, upstream: ClientConnection) -> None:
    """Both ways, until one end closes; then close the other."""
    down = asyncio.create_task(_down(socket, upstream), name="relay down")
    up = asyncio.create_task(_up(socket, upstream), name="relay up")
    try:
        await asyncio.wait({down, up}, return_when=asyncio.FIRST_COMPLETED)
        if down.done() and down.exception() is None:
            lost = upstream.close_code is None or upstream.close_code == 1006
            code, reason = upstream.close_code or 0, upstream.close_reason or ""
            if lost:
                code, reason = errors.close_code(LOST), str(LOST)
            await _close(socket, code, reason)
    finally:
        down.cancel()
        up.cancel()
        await asyncio.wait({down, up})


async def _down(socket: WebSocket, upstream: ClientConnection) -> None:
    """Raises TimeoutError when the reader takes nothing, WebSocketDisconnect when it is gone."""
    with contextlib.suppress(ConnectionClosed):
        while True:
            message = await upstream.recv()
            async with asyncio.timeout(STALL_S):
                try:
                    if isinstance(message, bytes):
                        await socket.send_bytes(message)
                    else:
                        await socket.send_text(message)
                except RuntimeError:  # uvicorn has closed it by itself meanwhile
                    raise WebSocketDisconnect(1006) from None


async def _up(socket: WebSocket, upstream: ClientConnection) -> None:
    """Until the client leaves."""
    with contextlib.suppress(ConnectionClosed):
        while (message := await socket.receive())["type"] != "websocket.disconnect":
            await upstream.send(message.get("bytes") or message.get("text") or b"")


async def _refuse(socket: WebSocket, error: WayfarerError) -> None:
    """Accepted first: browsers hide code and reason from a page otherwise."""
    if socket.application_state is WebSocketState.CONNECTING:
        await socket.accept(_offered(socket))
    reason = errors.close_reason(error)
    await _close(socket, errors.close_code(error), reason)


async def _close(socket: WebSocket, code: int, reason: str) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # it has left at the same moment
        await socket.close(code, reason)


def _offered(socket: WebSocket) -> str | None:
    return SUBPROTOCOL if SUBPROTOCOL in socket.scope["subprotocols"] else None


def _session_in(frame: bytes | str) -> str:
    """Named by the first frame of control; empty for what the worker will refuse."""
    try:
        data = frame if isinstance(frame, bytes) else frame.encode()
        return control_pb2.ControlRequest.FromString(data).open.session_id
    except DecodeError:
        return ""
