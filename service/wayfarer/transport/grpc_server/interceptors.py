"""Interceptors of all calls: malformed requests and errors become statuses."""

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import aclosing, asynccontextmanager
from typing import Any, Final

import grpc
import structlog
from google.protobuf.message import DecodeError

from wayfarer.errors import InvalidArgument
from wayfarer.transport import errors
from wayfarer.transport.edge.grpc_guard import around

log = structlog.get_logger(__name__)

OURS: Final = "/wayfarer."

Continuation = Callable[[grpc.HandlerCallDetails], Awaitable[Any]]


class ErrorInterceptor(grpc.aio.ServerInterceptor):
    """Ends a call that raised with the status of errors.py; logs unexpected errors.

    It is the outermost. CancelledError and AbortError pass through.
    """

    async def intercept_service(
        self, continuation: Continuation, handler_call_details: grpc.HandlerCallDetails
    ) -> Any:
        """Wraps the handler."""
        handler = await continuation(handler_call_details)
        method = handler_call_details.method
        if handler is None or not method.startswith(OURS):
            return handler
        return around(handler, lambda context: _translated(method, context))


class DecodeInterceptor(grpc.aio.ServerInterceptor):
    """Parses requests inside the others, since gRPC itself reports a malformed one as INTERNAL.

    It is the innermost.
    """

    async def intercept_service(
        self, continuation: Continuation, handler_call_details: grpc.HandlerCallDetails
    ) -> Any:
        """Wraps the handler in a handler that takes bytes."""
        handler = await continuation(handler_call_details)
        if handler is None or not handler_call_details.method.startswith(OURS):
            return handler
        return _decoding(handler)


@asynccontextmanager
async def _translated(method: str, context: Any) -> AsyncIterator[None]:
    try:
        yield
    except grpc.aio.AbortError:
        raise
    except Exception as error:
        errors.log_unexpected(log, error, method)
        await context.abort_with_status(errors.to_grpc(error))


def _decoding(handler: Any) -> Any:
    write = handler.response_serializer

    def read(data: bytes) -> Any:
        try:
            return handler.request_deserializer(data)
        except DecodeError:
            raise InvalidArgument("not a protobuf message of this call; see proto/") from None

    async def read_all(pieces: AsyncIterator[bytes]) -> AsyncIterator[Any]:
        async for piece in pieces:
            yield read(piece)

    if handler.stream_stream:
        return grpc.stream_stream_rpc_method_handler(
            lambda pieces, context: handler.stream_stream(read_all(pieces), context), None, write
        )
    if handler.stream_unary:
        return grpc.stream_unary_rpc_method_handler(
            lambda pieces, context: handler.stream_unary(read_all(pieces), context), None, write
        )
    if handler.unary_stream:
        # parsed when the stream is read, so that the other interceptors see its errors
        async def stream(data: bytes, context: Any) -> AsyncIterator[Any]:
            async with aclosing(handler.unary_stream(read(data), context)) as messages:
                async for message in messages:
                    yield message

        return grpc.unary_stream_rpc_method_handler(stream, None, write)

    async def single(data: bytes, context: Any) -> Any:
        return await handler.unary_unary(read(data), context)

    return grpc.unary_unary_rpc_method_handler(single, None, write)
