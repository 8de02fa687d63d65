"""The public ports of a server with several workers.

Everything works through them: a call on a session goes to its worker, a new session to the least
loaded one, and calls that concern all workers go to all. The workers authenticate and authorise:
the front passes the caller's credentials on.
"""

import asyncio
from typing import Final

import grpc
from fastapi import FastAPI
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute

from wayfarer.config import Settings
from wayfarer.errors import Unavailable
from wayfarer.limits import Limits
from wayfarer.transport.grpc_server import GrpcServer, bracketed
from wayfarer.transport.ports import bind, http_url
from wayfarer.transport.request_limits import RequestLimits, add_problem_handlers
from wayfarer.transport.server import HttpServer
from wayfarer.transport.server_options import ServerOptions
from wayfarer.transport.worker_sockets import WorkerSockets
from wayfarer.workers.grpc_relay import GrpcRelay
from wayfarer.workers.http_relay import HttpRelay
from wayfarer.workers.metrics import merged_page
from wayfarer.workers.placement import Placement
from wayfarer.workers.socket_relay import SocketRelay
from wayfarer.workers.supervisor import Supervisor

METHODS: Final = ["GET", "HEAD", "OPTIONS", "POST", "PUT", "PATCH", "DELETE"]
WATCH_S: Final = 0.1
"""Seconds between checks of the workers' health."""

METRICS_S: Final = 2.0
"""Timeout of a request for a worker's metrics."""


class Front:
    """gRPC and HTTP. Binds when created, so a port in use is known at once."""

    def __init__(
        self,
        settings: Settings,
        operation: ServerOptions,
        doors: list[WorkerSockets],
        placement: Placement,
        supervisor: Supervisor,
    ) -> None:
        """`doors`: of the workers, in order. Create it inside a running event loop.

        Raises Unavailable when a port is taken.
        """
        host, tls = settings.host, operation.tls
        # the limit of each worker, summed
        limits = settings.limits.model_copy(
            update={"streams": settings.limits.streams * len(doors)}
        )
        self._supervisor = supervisor
        self._socket = bind(host, settings.http_port, settings.grpc_port)
        self._grpc_relay = GrpcRelay([door.grpc for door in doors], placement)
        self._grpc = GrpcServer(
            self._add_relay,
            limits,
            host,
            settings.grpc_port,
            tls.grpc() if tls else None,
            connections=operation.connections,
        )
        http_sockets = [door.http for door in doors]
        self._http_relay = HttpRelay(http_sockets, placement, operation.connections)
        app = self._app(SocketRelay(http_sockets, placement, operation), limits)
        self._http = HttpServer(app, limits, operation)
        self._drain_s = operation.drain_s
        self.http_url = http_url(host, self._socket, bool(tls))
        self.grpc_address = f"{bracketed(host)}:{self._grpc.port}"
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> None:
        """Take calls; they fail with Unavailable until a worker is ready."""
        await self._grpc.start()
        self._tasks = [
            asyncio.create_task(self._watch(), name="watch"),
            asyncio.create_task(self._http.serve(sockets=[self._socket]), name="http"),
        ]

    async def drain(self) -> None:
        """Say that new work is not welcome; calls under way go on."""
        self._tasks[0].cancel()
        await self._grpc.enter_shutdown()

    async def stop(self) -> None:
        """Stop, once the workers have."""
        watch, http = self._tasks
        watch.cancel()
        self._http.should_exit = True
        await asyncio.gather(self._grpc.stop(self._drain_s), http)
        await asyncio.gather(self._grpc_relay.close(), self._http_relay.close())

    def _add_relay(self, server: grpc.aio.Server) -> None:
        server.add_generic_rpc_handlers((self._grpc_relay,))

    def _app(self, sockets: SocketRelay, limits: Limits) -> FastAPI:
        app = FastAPI(openapi_url=None)
        add_problem_handlers(app)
        app.add_middleware(
            RequestLimits, body_bytes=limits.message_bytes, mesh_bytes=limits.mesh_bytes
        )
        app.router.routes += [
            WebSocketRoute("/v1/stream", sockets.stream),
            WebSocketRoute("/v1/control", sockets.control),
            Route("/v1/health/{probe:str}", self._health, methods=["GET"]),
            Route("/metrics", self._metrics, methods=["GET"]),
            Route("/{rest:path}", self._http_relay.handle, methods=METHODS),
        ]
        return app

    async def _health(self, request: Request) -> Response:
        """Live while it answers: the supervisor starts again what is not."""
        probe, supervisor = request.path_params["probe"], self._supervisor
        states = {
            "live": (True, "live", ""),
            "ready": (supervisor.ready, "ready", "not ready"),
            "startup": (supervisor.started, "started", "starting"),
        }
        if probe not in states:
            return await self._http_relay.handle(request)
        good, yes, no = states[probe]
        workers = [
            "ready" if w.report.ready else "live" if w.report.alive else "down"
            for w in supervisor.workers
        ]
        document = {"status": yes if good else no, "workers": workers}
        return JSONResponse(document, 200 if good else 503)

    async def _metrics(self, request: Request) -> Response:
        running = [w.index for w in self._supervisor.workers if w.report.started]
        if not running:
            raise Unavailable("no worker runs; they are starting or stopping")
        found = await self._http_relay.ask(running, request, read_s=METRICS_S)
        if isinstance(found, Response):
            return found
        pages = dict(zip(running, (page.decode() for page in found), strict=True))
        page = merged_page(pages, self._supervisor.workers)
        return Response(page, media_type="text/plain; version=0.0.4; charset=utf-8")

    async def _watch(self) -> None:
        """Keep grpc.health.v1 in step with the workers."""
        while True:
            await self._grpc.set_serving(self._supervisor.ready)
            await asyncio.sleep(WATCH_S)
