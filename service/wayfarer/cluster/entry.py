"""The service that clients of a cluster meet first: it says which node to call.

It relays nothing. A call ends with Misdirected and the endpoint of a node: the node that has the
session or, for a new session, the node with the most room. The entry itself answers only calls that
concern all nodes (every_node.py). Any number of entries may run: their knowledge comes from the
directory, and is mostly right while the directory is away.
"""

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Any, Final

import grpc
import structlog
from fastapi import FastAPI
from google.protobuf.message import DecodeError
from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from wayfarer.cluster.every_node import Calls, calls_to_all
from wayfarer.cluster.group_map import endpoint
from wayfarer.cluster.messages import DirectoryLink, NodeInfo, NodeLink
from wayfarer.cluster.node_finder import LOOK_S, ClusterFigures, NodeFinder
from wayfarer.cluster.routes import (
    METHODS,
    Subject,
    grpc_subject,
    http_is_for_all,
    http_subject,
    is_for_all,
    session_of,
)
from wayfarer.config.settings import Settings
from wayfarer.endpoint import bracketed
from wayfarer.errors import (
    FailedPrecondition,
    InvalidArgument,
    Misdirected,
    Unavailable,
    WayfarerError,
)
from wayfarer.runtime.stats import LoopStats
from wayfarer.transport import errors
from wayfarer.transport.contract import Rpc
from wayfarer.transport.conversion.wire import answer, from_message
from wayfarer.transport.edge.asgi import front
from wayfarer.transport.edge.caller import Scope, current_caller
from wayfarer.transport.edge.grpc_guard import GuardInterceptor
from wayfarer.transport.edge.http_guard import SUBPROTOCOL
from wayfarer.transport.edge.ports import bind, http_url
from wayfarer.transport.edge.request_limits import MESHES, RequestLimits, add_problem_handlers
from wayfarer.transport.gateway.session_locator import misdirected
from wayfarer.transport.grpc_server import GrpcServer
from wayfarer.transport.http_server.calls import call_routes
from wayfarer.transport.server import HttpServer
from wayfarer.transport.server_options import ServerOptions
from wayfarer.v1 import control_pb2

log = structlog.get_logger(__name__)

FIRST_S: Final = 10.0
"""Seconds within which a call must name its session or scene."""

VERBS: Final = ["GET", "HEAD", "OPTIONS", "POST", "PUT", "PATCH", "DELETE"]


class Entry:
    """gRPC and HTTP. Binds when created, so a port in use is known at once."""

    def __init__(
        self,
        settings: Settings,
        directory: DirectoryLink,
        nodes: NodeLink,
        stop: Callable[[], None],
    ) -> None:
        """`stop` is what AdminService.Drain does.

        Create it inside a running event loop. Raises Unavailable when a port is taken.
        """
        operation = ServerOptions.from_settings(settings)
        host, tls, limits = settings.host, operation.tls, settings.limits
        self._directory, self.finder = directory, NodeFinder(directory)
        calls = calls_to_all(nodes, self.finder.all_nodes, stop)
        self._socket = bind(host, settings.http_port, settings.grpc_port)
        guard = GuardInterceptor(
            operation.guard, operation.metrics, operation.tracing, operation.access_log
        )
        redirecting = _Redirecting(self.finder, calls)
        self._grpc = GrpcServer(
            lambda server: server.add_generic_rpc_handlers((redirecting,)),
            limits,
            host,
            settings.grpc_port,
            tls.grpc() if tls else None,
            [guard],
            connections=operation.connections,
        )
        operation.metrics.registry.register(ClusterFigures(self.finder))
        app = FastAPI(openapi_url=None)
        add_problem_handlers(app)
        app.add_middleware(
            RequestLimits, body_bytes=limits.message_bytes, mesh_bytes=limits.mesh_bytes
        )
        app.include_router(call_routes(calls, {}))
        app.router.routes += [
            WebSocketRoute("/v1/stream", self._socket_redirect),
            WebSocketRoute("/v1/control", self._socket_redirect),
            Route("/v1/health/{probe:str}", self._health, methods=["GET"]),
            Route("/v1/cluster", self._status, methods=["GET"]),
            Route("/v1/cluster/targets", self._targets, methods=["GET"]),
            Route("/v1/cluster/nodes/{name:str}/drain", self._drain, methods=["POST"]),
            Route("/{rest:path}", self._redirect, methods=VERBS),
        ]
        self._http = HttpServer(front(app, operation, _no_loop), limits, operation)
        self._drain_s = operation.drain_s
        self._guard = operation.guard
        self.http_url = http_url(host, self._socket, tls is not None)
        self.grpc_address = f"{bracketed(host)}:{self._grpc.port}"
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> None:
        """Begins to take calls."""
        await self._grpc.start()
        self._tasks = [
            asyncio.create_task(self._http.serve(sockets=[self._socket]), name="http"),
            asyncio.create_task(self.finder.watch(), name="directory"),
            asyncio.create_task(self._tell_health(), name="health"),
        ]

    def reload(self) -> None:
        """Reads the keys again."""
        self._guard.authenticator.reload()

    def drain(self) -> None:
        """Says from now on that new work is not welcome."""
        self.finder.closing = True

    async def stop(self) -> None:
        """Ends the entry. Streams do not notice: they go to the nodes."""
        http, *others = self._tasks
        for task in others:
            task.cancel()
        self._http.should_exit = True
        await asyncio.gather(self._grpc.stop(self._drain_s), http)

    async def _tell_health(self) -> None:
        while True:
            await self._grpc.set_serving(self.finder.ready)
            await asyncio.sleep(LOOK_S)

    # HTTP

    async def _redirect(self, request: Request) -> Response:
        path, verb = request.scope["path"], request.method
        if http_is_for_all(verb, path):
            told = "concerns each node by itself: GET /v1/cluster lists them"
            raise FailedPrecondition(f"{verb} {path} {told}")
        key = request.headers.get("idempotency-key", "")
        body = b"" if path == MESHES else await request.body()
        subject = http_subject(verb, path, request.url.query, key, body)
        is_page = not path.startswith("/v1/")
        node = await self.finder.node(subject, "" if is_page else current_caller().name)
        if is_page:
            host = bracketed(node.host or request.url.hostname or "localhost")
            where = request.url.replace(netloc=f"{host}:{node.http_port}")
            return RedirectResponse(str(where), 307)
        raise _elsewhere(subject, f"{verb} {path}", node)

    async def _socket_redirect(self, socket: WebSocket) -> None:
        """Closes a WebSocket with the endpoint as its reason."""
        await socket.accept(SUBPROTOCOL if SUBPROTOCOL in socket.scope["subprotocols"] else None)
        try:
            name = session_of(socket.url.query) or await _opened(socket)
            node = await self.finder.node(("named", name), current_caller().name)
            error: WayfarerError = misdirected(name, endpoint(node))
        except WayfarerError as found:
            error = found
        await socket.close(errors.close_code(error), errors.close_reason(error))

    async def _health(self, request: Request) -> Response:
        """Live while it answers; ready and startup say why not."""
        where, probe = self.finder, request.path_params["probe"]
        good = probe == "live" or (probe in ("ready", "startup") and where.ready)
        nodes = len(where.status.nodes) if where.status else 0
        told = {"status": probe if good else f"not {probe}", "nodes": nodes, "away": where.away}
        told |= {} if where.head is None else {"head": where.head}
        return JSONResponse(told, 200 if good else 503)

    async def _status(self, request: Request) -> Response:
        """The directory at a glance."""
        current_caller().require(Scope.READ)
        if self.finder.status is None or self.finder.away:
            raise Unavailable("the cluster's directory is away")
        told = self.finder.status.model_dump(mode="json")
        return JSONResponse(told | {"head": self.finder.head})

    async def _targets(self, request: Request) -> Response:
        """Prometheus's service discovery."""
        current_caller().require(Scope.READ)
        return JSONResponse(self.finder.targets(request.url.hostname or "localhost"))

    async def _drain(self, request: Request) -> Response:
        """Asks a node to give its sessions to others and to end."""
        current_caller().require(Scope.ADMIN)
        name = request.path_params["name"]
        await self._directory.call("drain", name)
        log.info("node is to drain", node=name)
        return Response(status_code=202)


class _Redirecting(grpc.GenericRpcHandler):
    """Ends each call with the endpoint of the node that takes it, except calls to all nodes."""

    def __init__(self, finder: NodeFinder, calls: Calls) -> None:
        self._finder = finder
        self._calls = calls

    def service(self, handler_call_details: grpc.HandlerCallDetails) -> Any:
        """The handler of a call; None where the method is not ours."""
        method = METHODS.get(handler_call_details.method)
        if method is None:
            return None

        async def handle(requests: AsyncIterator[bytes], context: Any) -> AsyncIterator[bytes]:
            try:
                async with asyncio.timeout(FIRST_S):
                    first = await anext(requests, b"")
            except TimeoutError:
                raise InvalidArgument(f"no request has come within {FIRST_S:g} s") from None
            if is_for_all(method):
                yield await self._on_all(method, first)
            else:
                raise await self._elsewhere(method, first)

        return grpc.stream_stream_rpc_method_handler(handle)

    async def _on_all(self, method: Rpc, first: bytes) -> bytes:
        call = from_message(method, self._calls[method.name])
        try:
            asked = method.request.FromString(first)
        except DecodeError:
            raise InvalidArgument("not a protobuf message of this call; see proto/") from None
        return answer(method.response, await call(asked)).SerializeToString()

    async def _elsewhere(self, method: Rpc, first: bytes) -> WayfarerError:
        subject = grpc_subject(method, first)
        node = await self._finder.node(subject, current_caller().name)
        return _elsewhere(subject, method.path, node)


async def _opened(socket: WebSocket) -> str:
    """The session that the first frame of control names. Raises InvalidArgument."""
    try:
        async with asyncio.timeout(FIRST_S):
            return control_pb2.ControlRequest.FromString(
                await socket.receive_bytes()
            ).open.session_id
    except (TimeoutError, WebSocketDisconnect, KeyError, TypeError, DecodeError):
        # too late, gone, a text frame, or malformed
        raise InvalidArgument("nothing was opened") from None


def _elsewhere(subject: Subject, call: str, node: NodeInfo) -> Misdirected:
    kind, name = subject
    if kind == "named":
        return misdirected(name, endpoint(node))
    return Misdirected(f"{call} is for node {node.number}; call {endpoint(node)}", endpoint(node))


async def _no_loop() -> LoopStats:
    raise Unavailable("an entry moves nobody")
