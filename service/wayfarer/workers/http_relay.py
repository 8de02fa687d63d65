"""HTTP of the front: requests go to a worker, and its answers back, piece by piece."""

import asyncio
import json
from collections.abc import AsyncIterator, Sequence
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final

import httpx
import structlog
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.types import Send

from wayfarer.errors import Unavailable
from wayfarer.transport import schema
from wayfarer.transport.connection import CERTIFICATE
from wayfarer.transport.http_server.streaming import Pieces
from wayfarer.transport.request_limits import MESHES
from wayfarer.transport.worker_sockets import PREFIX, ClientOrigin
from wayfarer.workers.merged import merged_json, merged_stats
from wayfarer.workers.placement import Placement
from wayfarer.workers.routes import RouteKind, http_kind, http_worker

log = structlog.get_logger(__name__)

TIMEOUTS: Final = {"connect": 5.0, "write": 30.0, "pool": 5.0}
"""Seconds."""

HOP: Final = frozenset(
    (b"connection", b"keep-alive", b"transfer-encoding", b"upgrade", b"te", b"trailer", b"expect")
)
"""Headers of one connection, which are not handed on."""

Headers = list[tuple[bytes, bytes]]
Body = bytes | AsyncIterator[bytes]


class HttpRelay:
    """One per front."""

    def __init__(self, sockets: Sequence[Path], placement: Placement, connections: int) -> None:
        """`sockets`: of the workers, in order; `connections`: to each at most."""
        self._placement = placement
        limits = httpx.Limits(max_connections=connections, max_keepalive_connections=32)
        self._workers = [httpx.AsyncHTTPTransport(uds=str(path), limits=limits) for path in sockets]

    async def close(self) -> None:
        """Close the connections."""
        for worker in self._workers:
            await worker.aclose()

    async def handle(self, request: Request) -> Response:
        """The answer. Raises Unavailable."""
        path = request.scope["path"]
        # a mesh goes on as it comes; the worker has room for few at a time
        body = request.stream() if path == MESHES else await request.body()
        if http_kind(request.method, path) is RouteKind.ALL:
            return await self._ask_all(request, await request.body())
        key = request.headers.get("idempotency-key", "")
        query = request.url.query
        told = body if isinstance(body, bytes) else b""
        worker = http_worker(request.method, path, query, key, told, self._placement)
        return Relayed(await self._send(worker, request, body))

    async def ask(
        self, workers: Sequence[int], request: Request, body: bytes = b"", read_s: float = 0.0
    ) -> list[bytes] | Response:
        """What several workers answer, in order, if that is OK; else the first other answer.

        `read_s`: how long that may take; 0: any time. Raises Unavailable.
        """
        answers = await asyncio.gather(
            *(self._read(worker, request, body, read_s) for worker in workers)
        )
        for status, headers, content in answers:
            if status >= HTTPStatus.MULTIPLE_CHOICES:
                return _response(status, headers, content)
        return [content for _, _, content in answers]

    async def _ask_all(self, request: Request, body: bytes) -> Response:
        found = await self.ask(range(len(self._workers)), request, body)
        if isinstance(found, Response):
            return found
        if not found[0]:
            return Response(status_code=204)
        documents = [json.loads(text) for text in found]
        if request.scope["path"] == "/v1/stats":
            stats = merged_stats([schema.Stats(**document) for document in documents])
            return JSONResponse(stats.model_dump())
        return JSONResponse(merged_json(documents))

    async def _read(
        self, worker: int, request: Request, body: bytes, read_s: float
    ) -> tuple[int, Headers, bytes]:
        answer = await self._send(worker, request, body, read_s)
        try:
            return answer.status_code, _kept(answer.headers.raw), await answer.aread()
        except httpx.HTTPError as error:
            raise _lost(worker, error) from None
        finally:
            await answer.aclose()

    async def _send(
        self, worker: int, request: Request, body: Body, read_s: float = 0.0
    ) -> httpx.Response:
        """The beginning of an answer. Raises Unavailable."""
        query = request.scope["query_string"]
        target = request.scope["raw_path"] + (b"?" + query if query else b"")
        relayed = httpx.Request(
            request.method,
            httpx.URL("http://worker/").copy_with(raw_path=target),
            headers=[*_kept(request.headers.raw), *relayed_headers(request.scope)],
            content=body if body else None,
            extensions={"timeout": {**TIMEOUTS, "read": read_s or None}},
        )
        try:
            return await self._workers[worker].handle_async_request(relayed)
        except httpx.HTTPError as error:
            raise _lost(worker, error) from None


class Relayed(Pieces):
    """The answer of a worker, as it comes."""

    def __init__(self, answer: httpx.Response) -> None:
        super().__init__(_pieces(answer), answer.status_code)
        self.raw_headers = _kept(answer.headers.raw)

    async def stream_response(self, send: Send) -> None:
        """As Pieces. One whose worker is lost is left unfinished, which its reader notices."""
        try:
            await super().stream_response(send)
        except httpx.HTTPError as error:
            log.info("worker lost in the middle of an answer", error=type(error).__name__)


def relayed_headers(scope: Any) -> Headers:
    """The client's identity, for the worker."""
    address = scope["client"][0] if scope.get("client") else ""
    origin = ClientOrigin(address, scope.get("state", {}).get(CERTIFICATE, ""))
    return [(key.encode(), value.encode()) for key, value in origin.headers().items()]


def _kept(headers: Sequence[tuple[bytes, bytes]]) -> Headers:
    """Those that are handed on."""
    return [
        (key.lower(), value)
        for key, value in headers
        if key.lower() not in HOP and not key.lower().startswith(PREFIX.encode())
    ]


def _response(status: int, headers: Headers, content: bytes) -> Response:
    response = Response(content, status)
    response.raw_headers = headers
    return response


async def _pieces(answer: httpx.Response) -> AsyncIterator[bytes]:
    try:
        async for piece in answer.aiter_raw():
            yield piece
    finally:
        await answer.aclose()


def _lost(worker: int, error: httpx.HTTPError) -> Unavailable:
    log.info("worker not reached", worker=worker, error=type(error).__name__)
    return Unavailable(f"worker {worker} is being started again; try again")
