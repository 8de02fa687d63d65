"""The ASGI application that uvicorn runs: guard, CORS and /metrics around the routes."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Collection, Sequence

from prometheus_client import make_asgi_app
from starlette.datastructures import Headers
from starlette.middleware.cors import CORSMiddleware
from starlette.types import ASGIApp, Receive, Scope, Send

from wayfarer.errors import WayfarerError
from wayfarer.runtime.stats import LoopStats
from wayfarer.transport.edge.caller import Scope as CallerScope
from wayfarer.transport.edge.caller import current_caller
from wayfarer.transport.edge.http_guard import HttpGuard, Nodes
from wayfarer.transport.edge.metrics import Metrics
from wayfarer.transport.edge.origins import LOOPBACK, is_page_of, machines_of, places_of
from wayfarer.transport.edge.prefix import UnderPrefix
from wayfarer.transport.edge.request_limits import problem_response
from wayfarer.transport.server_options import ServerOptions

POLICY = "content-security-policy"
"""Header that names the cluster's nodes; the page of another node asks for it (viewer/nodes.js)."""

STATS_S = 1.0
"""Seconds that /metrics waits for the motion loop before it answers without the loop's figures."""

Stats = Callable[[], Awaitable[LoopStats]]


def front(
    app: ASGIApp, operation: ServerOptions, stats: Stats, nodes: Nodes | None = None
) -> ASGIApp:
    """Wraps `app` in all that runs before it. `nodes`: of the cluster; their pages may call."""
    if operation.metrics_access != "off":
        app = MetricsEndpoint(app, operation.metrics, stats, operation.metrics_access == "guarded")
    guarded: ASGIApp = HttpGuard(
        app,
        operation.guard,
        operation.origins,
        operation.metrics,
        operation.tracing,
        access_log=operation.access_log,
        metrics_open=operation.metrics_access != "guarded",
        nodes=nodes or tuple,
    )
    guarded = cors(guarded, operation.origins.listed)
    if nodes is not None:
        guarded = SiblingPages(guarded, nodes, operation.origins.nodes)
    return UnderPrefix(guarded, operation.root_path, operation.proxies)


class SiblingPages:
    """CORS for the pages of a cluster's machines; other requests go to `app`."""

    def __init__(self, app: ASGIApp, nodes: Nodes, later: Collection[str] = ()) -> None:
        """`later`: hosts of nodes that may come; see `Origins.nodes`."""
        self._app = app
        self._nodes = nodes
        self._later = later

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        app = self._app
        if scope["type"] == "http":
            headers = Headers(scope=scope)
            if origin := headers.get("origin", ""):
                places = places_of(self._nodes(), headers.get("host", ""))
                if places and is_page_of(origin, machines_of(places, self._later)):
                    app = cors(app, [origin], [POLICY])
        await app(scope, receive, send)


def cors(app: ASGIApp, origins: Collection[str], headers: Sequence[str] = ()) -> ASGIApp:
    """Lets pages of these origins, and of this machine, read answers and their `headers`.

    The same pages may also change things; see `Origins.allows`.
    """
    return CORSMiddleware(
        app,
        allow_origins=sorted(origins),
        allow_origin_regex=LOOPBACK,
        allow_methods=["GET", "POST", "PUT", "PATCH", "DELETE"],
        allow_headers=["authorization", "x-api-key", "content-type", "x-request-id",
                       "idempotency-key", "last-event-id", "if-match"],
        expose_headers=["x-request-id", "retry-after", "www-authenticate", *headers],
        max_age=600,
    )  # fmt: skip


class MetricsEndpoint:
    """`GET /metrics` for Prometheus; other requests go to `app`."""

    def __init__(self, app: ASGIApp, metrics: Metrics, stats: Stats, guarded: bool) -> None:
        self._app = app
        self._metrics = metrics
        self._stats = stats
        self._guarded = guarded
        self._page = make_asgi_app(metrics.registry)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http" or scope["path"] != "/metrics":
            await self._app(scope, receive, send)
            return
        try:
            if self._guarded:
                current_caller().require(CallerScope.READ)
        except WayfarerError as error:
            await problem_response(error)(scope, receive, send)
            return
        with contextlib.suppress(WayfarerError, TimeoutError):  # a loop that hangs is worth a look
            async with asyncio.timeout(STATS_S):
                self._metrics.refresh(await self._stats())
        await self._page(scope, receive, send)
