"""Both servers over one Gateway, in the running event loop."""

import asyncio
import contextlib
import socket
from collections.abc import Iterator
from typing import Final

import structlog
import uvicorn

from wayfarer.errors import Unavailable
from wayfarer.transport.connection import HttpConnection, SocketConnection
from wayfarer.transport.front import front
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.grpc_guard import GuardInterceptor
from wayfarer.transport.grpc_server import GrpcServer, bracketed
from wayfarer.transport.guard import Guard
from wayfarer.transport.http_server import http_app
from wayfarer.transport.limits import CallRates
from wayfarer.transport.operation import Operation

log = structlog.get_logger(__name__)

WATCH_S: Final = 0.25
"""Between looks at the health of the runtime."""

HEADER_BYTES: Final = 32 * 1024
"""Of the head of an HTTP request."""


class _Uvicorn(uvicorn.Server):
    """Signals are the composition root's business."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave them alone."""
        yield


class Server:
    """gRPC and HTTP. Binds when created, so a port in use is known at once."""

    def __init__(
        self,
        gateway: Gateway,
        host: str,
        http_port: int,
        grpc_port: int,
        operation: Operation | None = None,
    ) -> None:
        """Ports 0: any free one. Raises Unavailable when one is taken."""
        self._gateway = gateway
        if operation is None:
            rates = CallRates(gateway.limits.calls_per_second)
            operation = Operation(guard=Guard(rates=rates))
        self._operation = operation
        # gRPC binds in C, which cannot say why it failed and writes lines of its own: try first.
        _listen(host, grpc_port, "gRPC").close()
        self._socket = _listen(host, http_port, "HTTP")
        tls = operation.tls
        self._grpc = GrpcServer(
            gateway,
            host,
            grpc_port,
            GuardInterceptor(
                operation.guard, operation.metrics, operation.tracing, operation.access_log
            ),
            tls.grpc() if tls else None,
        )
        self._uvicorn = _Uvicorn(
            uvicorn.Config(
                front(http_app(gateway), operation, gateway.loop_stats),
                http=HttpConnection,
                ws=SocketConnection,
                lifespan="off",
                log_config=None,
                access_log=False,
                server_header=False,
                proxy_headers=False,
                limit_concurrency=operation.connections,
                h11_max_incomplete_event_size=HEADER_BYTES,
                ws_max_size=gateway.limits.message_bytes,
                ws_per_message_deflate=False,
                timeout_graceful_shutdown=max(1, round(operation.drain_s)),
                ssl_context_factory=(lambda *_: tls.http()) if tls else None,
            )
        )
        scheme = "https" if tls else "http"
        self.http_url = f"{scheme}://{bracketed(host)}:{self._socket.getsockname()[1]}"
        self.grpc_address = f"{bracketed(host)}:{self._grpc.port}"
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> None:
        """Take calls. Health says NOT_SERVING until the runtime is ready."""
        await self._grpc.start()
        self._tasks = [
            asyncio.create_task(self._uvicorn.serve(sockets=[self._socket]), name="http"),
            asyncio.create_task(self._watch(), name="watch"),
        ]

    async def until_ready(self) -> None:
        """Return when the runtime is ready. Raises Unavailable when it will never be."""
        while not (self._gateway.runtime_ready and self._uvicorn.started):
            if not self._gateway.alive:
                raise Unavailable("the motion loop ended while it was starting; see the log")
            await asyncio.sleep(0.01)
        await self._gateway.take_over()
        await self._grpc.set_serving(True)

    async def stop(self) -> None:
        """Refuse new work, tell and end the streams, let calls end, stop.

        Takes twice `drain_s` at most, and a second.
        """
        http, watch = self._tasks
        watch.cancel()
        await self._grpc.enter_shutdown()
        await self._gateway.drain(self._operation.drain_s)
        self._uvicorn.should_exit = True
        await asyncio.gather(self._grpc.stop(self._operation.drain_s), http)
        self._operation.tracing.close()

    async def _watch(self) -> None:
        """Keep grpc.health.v1 in step with the runtime, and end sessions whose lease is over."""
        while True:
            await self._grpc.set_serving(self._gateway.ready)
            try:
                await self._gateway.end_expired_sessions()
            except Exception:  # else no lease would ever end again
                log.exception("sessions whose lease is over not ended; tried again")
            await asyncio.sleep(WATCH_S)


def _listen(host: str, port: int, what: str) -> socket.socket:
    """A listening socket. Raises Unavailable."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family, backlog=1024)
    except OSError as error:
        raise Unavailable(
            f"cannot listen for {what} on {bracketed(host)}:{port}: {error.strerror}; "
            f"choose another with --{what.lower()}-port (0: any)"
        ) from None
