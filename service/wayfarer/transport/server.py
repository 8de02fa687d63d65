"""Both servers over one Gateway, in the running event loop."""

import asyncio
import contextlib
from collections.abc import Iterator
from functools import partial
from typing import Final

import structlog
import uvicorn
from starlette.types import ASGIApp

from wayfarer.config.limits import Limits
from wayfarer.endpoint import bracketed
from wayfarer.errors import Unavailable
from wayfarer.transport.edge.asgi import front
from wayfarer.transport.edge.call_rates import CallRates
from wayfarer.transport.edge.connection import HttpConnection, SocketConnection
from wayfarer.transport.edge.grpc_guard import GuardInterceptor
from wayfarer.transport.edge.guard import Guard
from wayfarer.transport.edge.ports import bind, http_url
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.grpc_server import GrpcServer, add_services
from wayfarer.transport.http_server import http_app
from wayfarer.transport.server_options import ServerOptions

log = structlog.get_logger(__name__)

WATCH_S: Final = 0.25
"""Seconds between checks of the runtime's health."""


class HttpServer(uvicorn.Server):
    """uvicorn with limits. The composition root handles signals."""

    def __init__(self, app: ASGIApp, limits: Limits, operation: ServerOptions) -> None:
        """HTTP on the sockets that `serve` receives."""
        tls = operation.tls
        super().__init__(
            uvicorn.Config(
                app,
                http=HttpConnection,
                ws=SocketConnection,
                lifespan="off",
                log_config=None,
                access_log=False,
                server_header=False,
                proxy_headers=False,
                limit_concurrency=operation.connections,
                ws_max_size=limits.message_bytes,
                ws_per_message_deflate=False,
                timeout_graceful_shutdown=max(1, round(operation.drain_s)),
                ssl_context_factory=(lambda *_: tls.http()) if tls else None,
            )
        )

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leaves signals alone."""
        yield


class Server:
    """gRPC and HTTP. Binds when created, so that a port in use is detected at once."""

    def __init__(
        self,
        gateway: Gateway,
        host: str,
        http_port: int,
        grpc_port: int,
        operation: ServerOptions | None = None,
    ) -> None:
        """A port 0 stands for any free one. Raises Unavailable if a port is taken."""
        self._gateway = gateway
        if operation is None:
            rates = CallRates(gateway.limits.calls_per_second)
            operation = ServerOptions(guard=Guard(rates=rates))
        self._operation = operation
        self._socket = bind(host, http_port, grpc_port)
        tls = operation.tls
        guard = GuardInterceptor(
            operation.guard, operation.metrics, operation.tracing, operation.access_log
        )
        self._grpc = GrpcServer(
            partial(add_services, gateway),
            gateway.limits,
            host,
            grpc_port,
            tls.grpc() if tls else None,
            [guard],
            operation.connections,
        )
        app = front(
            http_app(gateway, operation.root_path), operation, gateway.loop_stats, gateway.nodes
        )
        self._http = HttpServer(app, gateway.limits, operation)
        self.http_url = http_url(host, self._socket, bool(tls))
        self.grpc_address = f"{bracketed(host)}:{self._grpc.port}"
        self._tasks: list[asyncio.Task[None]] = []

    @property
    def ports(self) -> tuple[int, int]:
        """The ports of gRPC and of HTTP."""
        return self._grpc.port, int(self._socket.getsockname()[1])

    async def start(self) -> None:
        """Accepts calls. Health is NOT_SERVING until the runtime is ready."""
        await self._grpc.start()
        self._tasks = [
            asyncio.create_task(self._watch(), name="watch"),
            asyncio.create_task(self._http.serve(sockets=[self._socket]), name="http"),
        ]

    async def until_ready(self) -> None:
        """Returns when the runtime is ready. Raises Unavailable if it never will be."""
        while not (self._gateway.runtime_ready and self._http.started):
            if not self._gateway.alive:
                raise Unavailable("the motion loop ended while it was starting; see the log")
            await asyncio.sleep(0.01)
        await self._gateway.take_over()
        await self._grpc.set_serving(True)

    async def stop(self) -> None:
        """Refuses new work, ends the streams with an event, lets calls end, and stops.

        Takes at most twice `drain_s` and a second.
        """
        watch, serving = self._tasks
        watch.cancel()
        await self._grpc.enter_shutdown()
        await self._gateway.drain(self._operation.drain_s)
        self._http.should_exit = True
        await asyncio.gather(self._grpc.stop(self._operation.drain_s), serving)
        self._operation.tracing.close()

    async def _watch(self) -> None:
        """Keeps grpc.health.v1 in step with the runtime; ends what has lost its lease or key."""
        while True:
            await self._grpc.set_serving(self._gateway.ready)
            self._gateway.end_streams_of_revoked(self._operation.guard.authenticator.is_good)
            try:
                await self._gateway.end_expired_sessions()
            except Exception:  # otherwise no lease would ever end again
                log.exception("sessions whose lease is over not ended; tried again")
            await asyncio.sleep(WATCH_S)
