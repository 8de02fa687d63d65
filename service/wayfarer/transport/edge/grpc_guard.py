"""gRPC interceptors: errors as statuses, the guard, figures, spans, log lines."""

import asyncio
import inspect
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import (
    AsyncGenerator,
    AsyncIterator,
    Awaitable,
    Callable,
    Iterable,
    Mapping,
)
from contextlib import aclosing, asynccontextmanager
from functools import partial
from typing import Any, Final
from urllib.parse import unquote

import grpc
import structlog

from wayfarer.errors import ResourceExhausted
from wayfarer.transport import errors
from wayfarer.transport.auth import Credentials
from wayfarer.transport.edge.guard import Guard, begin
from wayfarer.transport.edge.http_guard import bearer
from wayfarer.transport.edge.metrics import Metrics
from wayfarer.transport.edge.tracing import Tracing

log = structlog.get_logger(__name__)

OURS: Final = "/wayfarer."
OPEN_STREAMS: Final = 8
"""Maximum streams of health and reflection, which need no credentials, from one address."""

Headers = dict[str, str]
Enter = Callable[[Any], Any]
"""Makes an asynchronous context manager from a call's context."""


class AroundInterceptor(grpc.aio.ServerInterceptor, ABC):
    """Wraps the handlers that it chooses, each once."""

    def __init__(self) -> None:
        self._wrapped: dict[str, tuple[Any, Any]] = {}  # the last handler of each method

    async def intercept_service(
        self,
        continuation: Callable[[grpc.HandlerCallDetails], Awaitable[Any]],
        handler_call_details: grpc.HandlerCallDetails,
    ) -> Any:
        """Wraps the handler."""
        handler, method = await continuation(handler_call_details), handler_call_details.method
        if handler is None:
            return None
        known, wrapped = self._wrapped.get(method, (None, None))
        if known is not handler:
            enter = self._enter(method, handler)
            wrapped = around(handler, enter) if enter else handler
            self._wrapped[method] = handler, wrapped
        return wrapped

    @abstractmethod
    def _enter(self, method: str, handler: Any) -> Enter | None:
        """The context in which a call is handled; None: the call is not wrapped."""


class OpenStreamsInterceptor(AroundInterceptor):
    """Limits the number of calls that need no credentials."""

    def __init__(self) -> None:
        super().__init__()
        self._open: Counter[str] = Counter()

    def _enter(self, method: str, handler: Any) -> Enter | None:
        is_open = handler.response_streaming and not method.startswith(OURS)
        return self._bounded if is_open else None

    @asynccontextmanager
    async def _bounded(self, context: Any) -> AsyncIterator[None]:
        name = address(context.peer())
        if self._open[name] >= OPEN_STREAMS:
            full = ResourceExhausted(f"{OPEN_STREAMS} such streams at a time from one address", 5.0)
            await context.abort_with_status(errors.to_grpc(full))
        self._open[name] += 1
        try:
            yield
        finally:
            self._open[name] -= 1
            if not self._open[name]:
                del self._open[name]


class GuardInterceptor(AroundInterceptor):
    """The guard. It ends a call that raised with the status of errors.py; logs unexpected errors.

    CancelledError and AbortError pass through.
    """

    def __init__(self, guard: Guard, metrics: Metrics, tracing: Tracing, access_log: bool) -> None:
        super().__init__()
        self._guard = guard
        self._metrics = metrics
        self._tracing = tracing
        self._access_log = access_log

    def _enter(self, method: str, handler: Any) -> Enter | None:
        return partial(self._call, method, handler) if method.startswith(OURS) else None

    @asynccontextmanager
    async def _call(self, method: str, handler: Any, context: Any) -> AsyncIterator[None]:
        started = time.perf_counter()
        code = "OK"
        headers = _headers(context)
        begin(headers.get("x-request-id", ""))
        try:
            with self._tracing.call(method.removeprefix("/"), headers):
                shown = _presented(headers, context.auth_context())
                await self._guard.admit(shown, address(context.peer()))
                yield
        except (asyncio.CancelledError, GeneratorExit):
            code = "CANCELLED"
            raise
        except Exception as error:
            code = errors.code_of(error).grpc.name
            if isinstance(error, grpc.aio.AbortError):
                raise
            errors.log_unexpected(log, error, method)
            await context.abort_with_status(errors.to_grpc(error))
        finally:
            self._note(method, handler, code, time.perf_counter() - started)

    def _note(self, method: str, handler: Any, code: str, seconds: float) -> None:
        if handler.request_streaming or handler.response_streaming:
            self._metrics.stream_ended(method, code)
        else:
            self._metrics.rpc(method, code, seconds)
        if self._access_log:
            log.info("call", method=method, code=code, ms=round(1e3 * seconds, 2))


def around(handler: Any, enter: Enter) -> Any:
    """Runs the handler within an asynchronous context manager made from the call's context."""
    if handler.response_streaming:
        inner_stream = handler.stream_stream or handler.unary_stream
        if inspect.iscoroutinefunction(inner_stream):  # it writes to the context itself

            async def writer(request: Any, context: Any) -> None:
                async with enter(context):
                    await inner_stream(request, context)

            return _streaming(handler, writer)

        async def stream(request: Any, context: Any) -> AsyncGenerator[Any]:
            async with enter(context), aclosing(inner_stream(request, context)) as messages:
                async for message in messages:
                    yield message

        return _streaming(handler, stream)
    inner = handler.stream_unary or handler.unary_unary

    async def single(request: Any, context: Any) -> Any:
        async with enter(context):
            return await inner(request, context)

    if handler.request_streaming:
        return grpc.stream_unary_rpc_method_handler(single, *_codec(handler))
    return grpc.unary_unary_rpc_method_handler(single, *_codec(handler))


def _streaming(handler: Any, behaviour: Any) -> Any:
    if handler.request_streaming:
        return grpc.stream_stream_rpc_method_handler(behaviour, *_codec(handler))
    return grpc.unary_stream_rpc_method_handler(behaviour, *_codec(handler))


def _codec(handler: Any) -> tuple[Any, Any]:
    return handler.request_deserializer, handler.response_serializer


def address(peer: str) -> str:
    """The address of a peer without port: "ipv4:10.0.0.1:4711" → "10.0.0.1"."""
    kind, _, rest = unquote(peer).partition(":")
    return rest.rpartition(":")[0] if kind in ("ipv4", "ipv6") else rest


def _headers(context: Any) -> Headers:
    """The first value of each text header."""
    found: Headers = {}
    for key, value in context.invocation_metadata() or ():
        if isinstance(value, str):
            found.setdefault(key, value)
    return found


def _presented(headers: Headers, connection: Mapping[str, Iterable[bytes]]) -> Credentials:
    """Reads credentials; `connection` is gRPC's description of it. Raises Unauthenticated."""
    names = connection.get("x509_common_name", ())
    return Credentials(
        bearer=bearer(headers.get("authorization", "")),
        api_key=headers.get("x-api-key", ""),
        certificate=next((name.decode("utf-8", "replace") for name in names), ""),
    )
