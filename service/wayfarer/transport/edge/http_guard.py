"""ASGI middleware around the HTTP routes and the WebSocket: the guard, figures, log lines."""

import time
from base64 import urlsafe_b64decode
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Final

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from wayfarer.endpoint import Endpoint
from wayfarer.errors import PermissionDenied, Unauthenticated, WayfarerError
from wayfarer.transport import errors
from wayfarer.transport.auth import Credentials
from wayfarer.transport.edge.connection import CERTIFICATE
from wayfarer.transport.edge.guard import Guard, begin
from wayfarer.transport.edge.metrics import Metrics
from wayfarer.transport.edge.origins import Origins, is_page_of, machines_of, places_of
from wayfarer.transport.edge.request_limits import problem_response
from wayfarer.transport.edge.tracing import Tracing

log = structlog.get_logger(__name__)

SUBPROTOCOL: Final = "wayfarer.v1"
TOKEN_SUBPROTOCOL: Final = "wayfarer.token."
"""Prefix of the key or token in base64url; a page can send no other header with a socket."""

GUARDED: Final = "/v1/"
"""Paths below it need an admitted caller."""

READS: Final = ("GET", "HEAD", "OPTIONS")
METHODS: Final = (*READS, "POST", "PUT", "PATCH", "DELETE")
STREAM_TYPES: Final = ("text/event-stream", "application/x-ndjson")
PAGE_POLICY: Final = (
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; "
    "img-src 'self' data: blob:; connect-src 'self' ws: wss: data: blob:; base-uri 'none'; "
    "form-action 'none'"
)
"""Content-Security-Policy of the viewer and of /docs: everything comes from this server."""

Nodes = Callable[[], Iterable[Endpoint]]
"""Returns the present nodes of the cluster."""

THIS_MACHINE: Final = ("http://localhost:*", "http://127.0.0.1:*")
"""Pages of the visitor's machine, as a policy names them."""

HOST_SHOWN: Final = 64
"""Maximum characters of a Host header that an error repeats."""


@dataclass(frozen=True, slots=True)
class HttpGuard:
    """Lets calls pass that `guard` admits; health and the viewer's files need no credentials."""

    app: ASGIApp
    guard: Guard
    origins: Origins
    metrics: Metrics
    tracing: Tracing
    access_log: bool = False
    metrics_open: bool = False
    nodes: Nodes = tuple

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handles one request or socket."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        request_id = begin(headers.get("x-request-id", ""))
        started = time.perf_counter()
        status, streams = 500, scope["type"] == "websocket"
        places = places_of(self.nodes(), headers.get("host", ""))
        machines = machines_of(places, self.origins.nodes) if places else []
        is_guarded = self._is_guarded(scope["path"])
        policy = page_policy(self.origins, *(() if is_guarded else (places, machines)))

        async def noted_send(message: Message) -> None:
            nonlocal status, streams
            if message["type"] == "http.response.start":
                status = message["status"]
                answer = MutableHeaders(scope=message)
                answer["x-request-id"] = request_id
                answer["content-security-policy"] = policy
                answer["x-frame-options"] = "SAMEORIGIN"  # for browsers without frame-ancestors
                streams = answer.get("content-type", "").startswith(STREAM_TYPES)
            elif message["type"] == "websocket.accept":
                if message.get("subprotocol") is None and SUBPROTOCOL in scope["subprotocols"]:
                    message["subprotocol"] = SUBPROTOCOL
            elif message["type"] == "websocket.close":
                status = message.get("code", 1000)
            await send(message)

        try:
            try:
                check_page(scope, headers, self.origins, machines)
                shown = presented(scope, headers)
                if is_guarded:
                    await self.guard.admit(shown, _address(scope))
            except WayfarerError as error:
                await _refuse(error, scope, receive, noted_send)
                return
            with self.tracing.call(_method(scope), headers) as rename:
                await self.app(scope, receive, noted_send)
                rename(f"{_method(scope)} {_route(scope)}")
        finally:
            self._note(scope, status, streams, time.perf_counter() - started)

    def _is_guarded(self, path: str) -> bool:
        if path == "/metrics":
            return not self.metrics_open
        return path.startswith(GUARDED) and not _is_health(path)

    def _note(self, scope: Scope, status: int, streams: bool, seconds: float) -> None:
        if streams:
            self.metrics.stream_ended(_route(scope), str(status))
        else:
            self.metrics.http(_method(scope), _route(scope), status, seconds)
        if self.access_log:
            path = scope["path"][:200]
            ms = round(1e3 * seconds, 2)
            log.info("call", method=_method(scope), path=path, status=status, ms=ms)


def check_page(
    scope: Scope, headers: Mapping[str, str], origins: Origins, machines: Collection[str] = ()
) -> None:
    """Refuses pages of other origins that open a socket or change something; CORS handles reads.
    Pages of a cluster's machines may do both. Raises PermissionDenied.
    """
    host = headers.get("host", "")
    if not origins.is_name(host) and not _is_health(scope["path"]):
        raise PermissionDenied(
            f"{host[:HOST_SHOWN]!r} is no name of this server; the setting allowed_hosts lists "
            "further ones, and localhost and addresses will do, too"
        )
    if scope["type"] == "http" and scope["method"] in READS:
        return
    origin = headers.get("origin")
    if not (origins.allows(origin, host) or is_page_of(origin or "", machines)):
        raise PermissionDenied(
            "web pages of this origin may not call; the setting cors_origins lists which may"
        )


def page_policy(origins: Origins, places: Iterable[str] = (), machines: Iterable[str] = ()) -> str:
    """Content-Security-Policy of the pages of this server.

    Pages that may call this server may frame them; those of the visitor's own machine may only if
    the server asks for no credentials. They may call the other nodes of the cluster: the nodes at
    `places`, which the page knows, and nodes that come later on `machines`. The policy is fixed
    when the page is opened.
    """
    local = () if origins.names is None else THIS_MACHINE
    framing = " ".join(("'self'", *local, *sorted(origins.listed)))
    anywhere = (f"{machine}:*" for machine in machines)
    called = " ".join(("connect-src 'self'", *places, *anywhere))
    policy = PAGE_POLICY.replace("connect-src 'self'", called)
    return f"{policy}; frame-ancestors {framing}"


def presented(scope: Scope, headers: Mapping[str, str]) -> Credentials:
    """The credentials of a request, except for a socket's token. Raises Unauthenticated."""
    return Credentials(
        bearer=_socket_token(scope) or bearer(headers.get("authorization", "")),
        api_key=headers.get("x-api-key", ""),
        certificate=scope.get("state", {}).get(CERTIFICATE, ""),
    )


def bearer(authorization: str) -> str:
    """The token of an Authorization header. Raises Unauthenticated for another scheme."""
    if not authorization:
        return ""
    scheme, _, token = authorization.partition(" ")
    if scheme.lower() != "bearer" or not token.strip():
        raise Unauthenticated("'authorization' must be: Bearer, a space, and the key or token")
    return token.strip()


def _socket_token(scope: Scope) -> str:
    offered = scope.get("subprotocols", ())
    tokens = [name for name in offered if name.startswith(TOKEN_SUBPROTOCOL)]
    if not tokens:
        return ""
    scope["subprotocols"] = [name for name in offered if name not in tokens]
    scope["headers"] = [
        (name, value) for name, value in scope["headers"] if name != b"sec-websocket-protocol"
    ]
    text = tokens[0].removeprefix(TOKEN_SUBPROTOCOL)
    try:
        return urlsafe_b64decode(text + "=" * (-len(text) % 4)).decode("ascii")
    except ValueError:
        raise Unauthenticated(
            f"the subprotocol {TOKEN_SUBPROTOCOL}… must end in the key or token in base64url"
        ) from None


def _is_health(path: str) -> bool:
    """Whether it is a probe. Any host name may be used, since it reveals only the health."""
    return path.startswith("/v1/health/")


def _address(scope: Scope) -> str:
    client = scope.get("client")
    return client[0] if client else ""


def _method(scope: Scope) -> str:
    method = scope.get("method", "WS")
    return method if method in METHODS or method == "WS" else "other"


def _route(scope: Scope) -> str:
    """The route's template, since metrics must not contain clients' text."""
    return getattr(scope.get("route"), "path", "") or "other"


async def _refuse(error: WayfarerError, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "http":
        response = problem_response(error)
        response.headers["cache-control"] = "no-store"
        await response(scope, receive, send)
        return
    # Accepted first: otherwise browsers hide code and reason from a page.
    await receive()
    await send({"type": "websocket.accept"})
    code, reason = errors.close_code(error), errors.close_reason(error)
    await send({"type": "websocket.close", "code": code, "reason": reason})
