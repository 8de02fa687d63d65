"""Bodies that are not what a route takes, and requests that are hardly HTTP."""

import asyncio
import contextlib
import json
from typing import Any
from urllib.parse import quote, urlsplit

import httpx

from tests.fuzz.inputs import FLOATS, Inputs
from tests.fuzz.tally import Quota, Tally

SURFACE = "HTTP"
PORT_SURFACE = "HTTP port"
LEFT_OUT = ("/v1/admin/drain", "/v1/events")
"""The server's shutdown, and an endless stream."""

CONTENT_TYPES = ("application/json", "application/json", "text/plain", "application/x-protobuf", "")
SNIPPETS = (
    *(b"NaN", b"Infinity", b"-1e999", b"1e400", b"9" * 400, b'"\\ud800"', b"\xff\xfe", b"null"),
    *(b"[" * 3000, b'{"a":' * 500, b'{"__proto__":1}', b'"\x00"', b"true", b"{}", b"[]", b""),
)
REQUEST_LINES = (
    *(b"GET /v1/sessions HTTP/1.1", b"POST /v1/sessions HTTP/1.1", b"GET", b"PUT  / HTTP/9.9"),
    b"GET /" + b"a" * 70_000 + b" HTTP/1.1",
)
HEADERS = (
    *(b"Host: x", b"Content-Length: 5", b"Content-Length: -1", b"Content-Length: 99999999999"),
    *(b"Transfer-Encoding: chunked", b"X: " + b"y" * 40_000, b"Expect: 100-continue"),
    *(b"Upgrade: websocket", b"Connection: Upgrade"),
)
BODIES = (b"", b"hello", b"5\r\nhello\r\n0\r\n\r\n", b"ffffffffffffffff\r\n", b"\x00" * 99)
SECONDS = 20.0
JSON = {"content-type": "application/json"}


async def operations(http: httpx.AsyncClient) -> list[tuple[str, str, Any]]:
    """Method, path and an example body (None: it takes none) of every route."""
    description = (await http.get("/openapi.json")).json()
    found: list[tuple[str, str, Any]] = []
    for path, methods in description["paths"].items():
        if path.startswith(LEFT_OUT):
            continue
        for method, operation in methods.items():
            content = operation.get("requestBody", {}).get("content", {})
            schema = content.get("application/json", {}).get("schema")
            example = _example(schema, description) if schema else None
            found.append((method.upper(), path, example))
    return found


def _example(schema: dict, description: dict) -> object:
    if "$ref" in schema:
        schema = description["components"]["schemas"][schema["$ref"].rsplit("/", 1)[1]]
    return (schema.get("examples") or [{}])[0]


async def use_everything(
    http: httpx.AsyncClient, known: dict[str, list[str]], tally: Tally
) -> None:
    """Calls each route once as its example has it, about the first known things, so that the
    server has loaded whatever it loads at first use.
    """
    for method, path, example in await operations(http):
        if method != "DELETE":
            target = path.format(**{name: things[0] for name, things in known.items()})
            if path == "/v1/clips":
                example |= {"seconds": 1.0}  # `campaign.SETTINGS` allow few
            body = json.dumps(example).encode() if example else b""
            await _ask(http, method, target, "example", body, JSON, tally)


async def worker(http: httpx.AsyncClient, inputs: Inputs, quota: Quota, tally: Tally) -> None:
    """Send requests, one at a time."""
    known = await operations(http)
    while await quota.take():
        method, path, example = inputs.chance.choice(known)
        kind, body = _body(inputs, example)
        headers = {"content-type": inputs.chance.choice(CONTENT_TYPES)}
        target = _fill(inputs, path)
        await _ask(http, method, target, kind, body, headers, tally)


async def _ask(
    http: httpx.AsyncClient,
    method: str,
    target: str,
    kind: str,
    body: bytes,
    headers: dict[str, str],
    tally: Tally,
) -> None:
    answer = await _answer(http, method, target, body, headers)
    if answer.startswith("5") or not answer.isdigit():
        tally.failure(SURFACE, kind, answer, f"{method} {target[:200]}", body)
    else:
        tally.answer(SURFACE, kind, answer)


async def _answer(
    http: httpx.AsyncClient, method: str, target: str, body: bytes, headers: dict[str, str]
) -> str:
    """Status, or the failure; only the beginning of an endless body is read."""
    try:
        async with (
            asyncio.timeout(SECONDS),
            http.stream(method, target, content=body or None, headers=headers) as response,
        ):
            with contextlib.suppress(StopAsyncIteration):
                await anext(response.aiter_raw())
            return str(response.status_code)
    except (httpx.HTTPError, httpx.InvalidURL, TimeoutError) as error:
        return type(error).__name__


def _fill(inputs: Inputs, path: str) -> str:
    """The path with names in place of its parameters."""
    while "{" in path:
        start, end = path.index("{"), path.index("}")
        name = inputs.text(path[start + 1 : end]) or "-"
        path = path[:start] + quote(name[:500], safe="") + path[end + 1 :]
    if inputs.chance.random() < 0.1:
        path += "?" + quote(inputs.text()[:500], safe="=&")
    return path


def _body(inputs: Inputs, example: object) -> tuple[str, bytes]:
    chance = inputs.chance
    if example is None and chance.random() < 0.7:
        return "empty", b""
    text = json.dumps(_twisted(inputs, example)).encode()
    match chance.choice(("extreme", "extreme", "mutated", "truncated", "random", "snippet")):
        case "mutated":
            return "mutated", inputs.mutate(text)
        case "truncated":
            return "truncated", text[: chance.randrange(len(text) + 1)]
        case "random":
            return "random", chance.randbytes(chance.choice((1, 50, 3000)))
        case "snippet":
            at = chance.randrange(len(text) + 1)
            return "mutated", text[:at] + chance.choice(SNIPPETS) + text[at:]
    if chance.random() < 0.02:
        return "oversized", b'{"a": "' + b"x" * (2 << 20) + b'"}'
    return "extreme", text


def _twisted(inputs: Inputs, value: object) -> object:
    """An example with some of its values replaced, and names that exist put in."""
    chance = inputs.chance
    if chance.random() < 0.1:
        return chance.choice((None, [], {}, -1, 1e308, "x", True, chance.choice(FLOATS), [[]] * 50))
    if isinstance(value, dict):
        made = {
            name: inputs.text(name) if name in inputs.known else _twisted(inputs, inner)
            for name, inner in value.items()
        }
        if chance.random() < 0.1:
            made[inputs.text()[:50]] = 1
        return made
    if isinstance(value, list):
        times = chance.choice((1, 1, 2, 300)) if len(value) < 4 else 1
        return [_twisted(inputs, inner) for inner in value * times]
    if isinstance(value, float) and chance.random() < 0.3:
        return chance.choice(FLOATS)
    return value


async def port_worker(url: str, inputs: Inputs, quota: Quota, tally: Tally) -> None:
    """Sends requests that are hardly HTTP; the server may only answer 4xx or hang up."""
    where = urlsplit(url)
    while await quota.take():
        answer = await _converse(where.hostname or "", where.port or 0, _request(inputs))
        if answer.startswith("5"):
            tally.failure(PORT_SURFACE, "random", answer, "raw", b"")
        else:
            tally.answer(PORT_SURFACE, "random", answer)


def _request(inputs: Inputs) -> bytes:
    chance = inputs.chance
    line = chance.choice((*REQUEST_LINES, chance.randbytes(40)))
    headers = [h for h in (*HEADERS, chance.randbytes(30)) if chance.random() < 0.3]
    return b"\r\n".join([line, *headers, b"", chance.choice(BODIES)])


async def _converse(host: str, port: int, data: bytes) -> str:
    with contextlib.suppress(OSError, TimeoutError):
        async with asyncio.timeout(0.3):
            reader, writer = await asyncio.open_connection(host, port)
            try:
                writer.write(data)
                await writer.drain()
                writer.write_eof()
                head = await reader.read(4096)
                parts = head.split(b" ", 2)
                return parts[1].decode("latin-1")[:3] if len(parts) > 1 else "hung up"
            finally:
                writer.close()
    return "hung up"
