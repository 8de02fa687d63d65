"""gRPC of the front: calls go to a worker as they come, as bytes, and its answers back.

Every call is relayed as a stream of messages each way: on the wire a unary call is one of one.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any, Final

import grpc

from wayfarer.errors import InvalidArgument, WayfarerError
from wayfarer.transport import errors
from wayfarer.transport.grpc_guard import origin_of
from wayfarer.transport.worker_sockets import PREFIX
from wayfarer.workers.merged import merged_messages
from wayfarer.workers.placement import Placement
from wayfarer.workers.routes import METHODS, RelayedMethod, RouteKind

OPTIONS: Final = [
    ("grpc.max_receive_message_length", -1),  # the workers' own bounds hold
    ("grpc.max_send_message_length", -1),
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.min_reconnect_backoff_ms", 5_000),  # that is how long an attempt may take
    ("grpc.max_reconnect_backoff_ms", 500),
    # what a slow reader leaves lying shall lie in the worker, which knows what to do about it
    ("grpc.http2.lookahead_bytes", 64 * 1024),
]

FIRST_S: Final = 30.0
"""Seconds until the first message of a call must have come."""

DETAILS: Final = "grpc-status-details-bin"

OURS_ALONE: Final = (PREFIX, "grpc-", ":")
"""What begins the names of metadata that are not handed on."""

Metadata = tuple[tuple[str, str | bytes], ...]


class GrpcRelay(grpc.GenericRpcHandler):
    """Handles every method of ours. Create it inside a running event loop."""

    def __init__(self, sockets: Sequence[Path], placement: Placement) -> None:
        """`sockets`: of the workers, in order."""
        self._placement = placement
        self._channels: list[Any] = [  # typed for calls with serialisers only
            grpc.aio.insecure_channel(f"unix:{path}", options=OPTIONS) for path in sockets
        ]

    def service(self, handler_call_details: grpc.HandlerCallDetails) -> Any:
        """The handler of a call; None where the method is not ours."""
        method = METHODS.get(handler_call_details.method)
        if method is None:
            return None

        async def handle(requests: AsyncIterator[bytes], context: Any) -> None:
            try:
                await self._relay(method, requests, context)
            except WayfarerError as error:
                await context.abort_with_status(errors.to_grpc(error))
            except grpc.aio.AioRpcError as error:
                await _end(context, error.code(), error.details(), error.trailing_metadata())

        return grpc.stream_stream_rpc_method_handler(handle)

    async def close(self) -> None:
        """Close the channels."""
        for channel in self._channels:
            await channel.close(None)

    async def _relay(
        self, method: RelayedMethod, requests: AsyncIterator[bytes], context: Any
    ) -> None:
        first = await _first(requests)
        metadata, timeout = _metadata(context), context.time_remaining()
        if method.kind is RouteKind.ALL:
            asked = (
                channel.unary_unary(method.path)(first or b"", metadata=metadata, timeout=timeout)
                for channel in self._channels
            )
            replies = await asyncio.gather(*(_awaited(call) for call in asked))
            parsed = [method.reply.FromString(reply) for reply in replies]
            await context.write(merged_messages(parsed).SerializeToString())
            return
        worker = method.worker(first or b"", self._placement)
        call = self._channels[worker].stream_stream(method.path)(metadata=metadata, timeout=timeout)
        up = asyncio.create_task(_send(call, first, requests), name="relay up")
        try:
            while (message := await call.read()) is not grpc.aio.EOF:  # type: ignore[attr-defined]
                await context.write(message)
            await _end(
                context, await call.code(), await call.details(), await call.trailing_metadata()
            )
        finally:
            up.cancel()
            call.cancel()
            await asyncio.wait([up])


async def _first(requests: AsyncIterator[bytes]) -> bytes | None:
    """The first message; None when none comes. Raises InvalidArgument when it takes too long.

    Until then the caller is not known.
    """
    try:
        async with asyncio.timeout(FIRST_S):
            return await anext(requests, None)
    except TimeoutError:
        raise InvalidArgument(f"no request has come within {FIRST_S:g} s") from None


async def _awaited(call: Any) -> bytes:
    """The reply of one of all workers. Raises AioRpcError."""
    return bytes(await call)


async def _send(call: Any, first: bytes | None, requests: AsyncIterator[bytes]) -> None:
    """Hand on what the client sends. Ends with the call, which then says why."""
    with contextlib.suppress(grpc.aio.AioRpcError, asyncio.InvalidStateError):
        if first is not None:
            await call.write(first)
        async for message in requests:
            await call.write(message)
        await call.done_writing()


async def _end(context: Any, code: Any, details: str | None, trailing: Any) -> None:
    """End the client's call as the worker's has ended."""
    kept = tuple(
        (key, value)
        for key, value in trailing or ()
        if key == DETAILS or not key.startswith("grpc-")
    )
    if code is grpc.StatusCode.OK:
        context.set_trailing_metadata(kept)
    else:
        await context.abort(code, details or "", kept)


def _metadata(context: Any) -> Metadata:
    """The client's, and who it is."""
    given = tuple(context.invocation_metadata() or ())
    texts = {key: value for key, value in given if isinstance(value, str)}
    kept = [
        (key, value)
        for key, value in given
        if not key.startswith(OURS_ALONE) and key != "user-agent"
    ]
    return (*kept, *origin_of(texts, context).headers().items())
