"""Both servers over one Gateway, in the running event loop."""

import asyncio
import contextlib
import socket
from collections.abc import Iterator
from typing import Final

import structlog
import uvicorn

from wayfarer.errors import Unavailable
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.grpc_server import GrpcServer, bracketed
from wayfarer.transport.http_server import http_app

log = structlog.get_logger(__name__)

GRACE_S: Final = 2.0
"""For streams and calls to end by themselves at shutdown."""

WATCH_S: Final = 0.25
"""Between looks at the health of the runtime."""


class _Uvicorn(uvicorn.Server):
    """Signals are the composition root's business."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave them alone."""
        yield


class Server:
    """gRPC and HTTP. Binds when created, so a port in use is known at once."""

    def __init__(self, gateway: Gateway, host: str, http_port: int, grpc_port: int) -> None:
        """Ports 0: any free one. Raises Unavailable when one is taken."""
        self._gateway = gateway
        # gRPC binds in C, which cannot say why it failed and writes lines of its own: try first.
        _listen(host, grpc_port, "gRPC").close()
        self._socket = _listen(host, http_port, "HTTP")
        self._grpc = GrpcServer(gateway, host, grpc_port)
        self._uvicorn = _Uvicorn(
            uvicorn.Config(
                http_app(gateway),
                lifespan="off",
                log_config=None,
                access_log=False,
                server_header=False,
                proxy_headers=False,
                ws_max_size=gateway.limits.message_bytes,
                ws_per_message_deflate=False,
                timeout_graceful_shutdown=round(GRACE_S),
            )
        )
        self.http_url = f"http://{bracketed(host)}:{self._socket.getsockname()[1]}"
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
        while not (self._gateway.ready and self._uvicorn.started):
            if not self._gateway.alive:
                raise Unavailable("the motion loop ended while it was starting; see the log")
            await asyncio.sleep(0.01)
        await self._grpc.set_serving(True)

    async def stop(self) -> None:
        """Refuse new work, end streams with Unavailable, let calls end, stop. Within seconds."""
        http, watch = self._tasks
        watch.cancel()
        await self._grpc.enter_shutdown()
        await self._gateway.drain(GRACE_S)
        self._uvicorn.should_exit = True
        await asyncio.gather(self._grpc.stop(GRACE_S), http)

    async def _watch(self) -> None:
        """Keep grpc.health.v1 in step with the runtime, and end idle sessions."""
        while True:
            await self._grpc.set_serving(self._gateway.ready)
            await self._gateway.end_idle_sessions()
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
