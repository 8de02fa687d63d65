"""uvicorn's connections with slow clients, and with too many."""

import asyncio
import contextlib
import json

import pytest
import uvicorn

from wayfarer.transport.edge.connection import (
    HEAD_BYTES,
    HttpConnection,
    SocketConnection,
    common_name,
)

PATIENCE_S = 0.3


class Impatient(HttpConnection):
    request_s = PATIENCE_S


async def echo(scope, receive, send):
    body, more = b"", True
    while more:
        message = await receive()
        body, more = body + message.get("body", b""), message.get("more_body", False)
    headers = [(b"content-length", b"%d" % len(body))]
    await send({"type": "http.response.start", "status": 200, "headers": headers})
    await send({"type": "http.response.body", "body": body})


@contextlib.asynccontextmanager
async def serving(connections: int = 8):
    config = uvicorn.Config(
        echo,
        http=Impatient,
        ws=SocketConnection,
        port=0,
        lifespan="off",
        log_config=None,
        limit_concurrency=connections,
    )
    server = uvicorn.Server(config)
    server.capture_signals = contextlib.nullcontext
    running = asyncio.create_task(server.serve())
    while not server.started:
        await asyncio.sleep(0.01)
    try:
        yield server.servers[0].sockets[0].getsockname()[1]
    finally:
        server.should_exit = True
        await running


async def opened(port: int, start: bytes = b""):
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(start)
    await writer.drain()
    return reader, writer


async def rest(reader) -> bytes:
    """Reads until the other end hangs up."""
    async with asyncio.timeout(5):
        with contextlib.suppress(ConnectionError):
            return await reader.read()
        return b""


@pytest.mark.parametrize(
    "start",
    [
        b"",
        b"GET / HTTP/1.1\r\nHost: a\r\n",
        b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 100\r\n\r\nabc",
        # the second one of two, half of which came with the first
        b"GET / HTTP/1.1\r\nHost: a\r\n\r\n"
        b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 9\r\n\r\na",
    ],
    ids=["nothing", "half a head", "half a body", "half of the second"],
)
async def test_a_request_that_does_not_come_is_not_waited_for(start):
    async with serving() as port:
        reader, writer = await opened(port, start)
        await rest(reader)
        writer.close()


async def test_drops_of_a_head_do_not_stretch_the_time():
    async with serving() as port:
        reader, writer = await opened(port, b"GET / HTTP/1.1\r\n")

        async def drip() -> None:
            while True:
                writer.write(b"a: b\r\n")
                await asyncio.sleep(0.02)

        dripping = asyncio.create_task(drip())
        await rest(reader)
        dripping.cancel()
        writer.close()


async def test_who_sends_whole_requests_may_stay():
    async with serving() as port:
        reader, writer = await opened(port)
        for _ in range(4):
            writer.write(b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 2\r\n\r\nhi")
            assert b"200" in await reader.readuntil(b"\r\n\r\n")
            await reader.readuntil(b"hi")
            await asyncio.sleep(PATIENCE_S / 2)
        writer.close()


async def test_beyond_the_limit_connections_are_closed_and_room_comes_back():
    async with serving(connections=4) as port:
        held = [await opened(port, b"GET / HTTP/1.1\r\n") for _ in range(4)]
        reader, writer = await opened(port, b"GET / HTTP/1.1\r\nHost: a\r\n\r\n")
        assert await rest(reader) == b""
        writer.close()
        for reader, writer in held:  # their time is up
            await rest(reader)
            writer.close()
        reader, writer = await opened(port, b"GET / HTTP/1.1\r\nHost: a\r\n\r\n")
        assert b"200" in await reader.readuntil(b"\r\n\r\n")
        writer.close()


def head_of(size: int) -> bytes:
    """A request whose head has `size` bytes."""
    start, end = b"GET / HTTP/1.1\r\nHost: a\r\n", b"\r\n"
    line = b"X-%04d: " + b"x" * 990 + b"\r\n"
    lines = [line % i for i in range((size - len(start) - len(end)) // len(line % 0) - 1)]
    left = size - len(start) - len(end) - sum(map(len, lines)) - len(b"X: \r\n")
    return start + b"".join(lines) + b"X: " + b"x" * left + b"\r\n" + end


@pytest.mark.parametrize(
    ("size", "pieces", "status"),
    [
        (HEAD_BYTES - 64, 1, b"200"),
        (HEAD_BYTES - 64, 7, b"200"),
        (HEAD_BYTES + 64, 1, b"431"),
        (HEAD_BYTES + 64, 7, b"431"),
        (100_000, 1, b"431"),
    ],
)
async def test_heads_are_bounded_in_one_piece_and_in_several(size, pieces, status):
    head = head_of(size)
    assert len(head) == size
    async with serving() as port:
        reader, writer = await opened(port)
        step = -(-size // pieces)
        for start in range(0, size, step):
            writer.write(head[start : start + step])
            await asyncio.sleep(0.01)
        assert (await reader.readline()).split()[1] == status
        writer.close()


@pytest.mark.parametrize(
    "request_line", [b"GET /" + b"x" * 40_000 + b" HTTP/1.1", b"x" * 40_000 + b" / HTTP/1.1"]
)
async def test_a_long_first_line_counts_too(request_line):
    async with serving() as port:
        reader, writer = await opened(port, request_line + b"\r\nHost: a\r\n\r\n")
        assert (await rest(reader)).startswith(b"HTTP/1.1 431 ")
        writer.close()


SMUGGLED = b"GET /smuggled HTTP/1.1\r\nHost: a\r\n\r\n"


@pytest.mark.parametrize(
    "lengths",
    [
        b"Content-Length: 5\r\nTransfer-Encoding: chunked\r\n",
        b"transfer-encoding: Chunked\r\ncontent-length: 0\r\n",
    ],
)
async def test_two_ways_to_tell_the_length_of_a_body_end_the_connection(lengths):
    async with serving() as port:
        start = b"POST / HTTP/1.1\r\nHost: a\r\n" + lengths + b"\r\n0\r\n\r\n" + SMUGGLED
        reader, writer = await opened(port, start)
        answer = await rest(reader)
        assert answer.startswith(b"HTTP/1.1 400 ") and answer.count(b"HTTP/1.1") == 1
        assert b"Connection: close" in answer
        assert json.loads(answer.partition(b"\r\n\r\n")[2]) == {
            "type": "about:blank",
            "title": "Bad Request",
            "status": 400,
            "detail": "Content-Length or Transfer-Encoding, not both",
        }
        writer.close()


@pytest.mark.parametrize(
    "start",
    [
        b"\x16\x03\x01\x02\x00\x01",  # TLS, spoken to a port without it
        b"GET / HTTP/1.1\r\n\r\n",  # no host
        b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n",
        b"POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\nno number\r\n",
    ],
    ids=["TLS", "no host", "two lengths", "no chunk"],
)
async def test_what_cannot_be_read_is_answered_and_ended(start):
    async with serving() as port:
        reader, writer = await opened(port, start + b"\r\n\r\n")
        assert (await rest(reader)).startswith(b"HTTP/1.1 400 ")
        writer.close()


def test_common_name():
    subject = ((("countryName", "CH"),), (("commonName", "ada"),))
    assert common_name({"subject": subject}) == "ada"
    assert common_name({"subject": ()}) == common_name({}) == common_name(None) == ""


async def test_a_websocket_handshake_that_cannot_be_read_is_refused():
    async with serving() as port:
        target = b"/" + b"x" * 20_000  # longer than a line that the WebSocket library reads
        start = b"GET " + target + b" HTTP/1.1\r\nHost: x\r\nConnection: Upgrade\r\n"
        reader, writer = await opened(port, start + b"Upgrade: websocket\r\n\r\n")
        assert (await rest(reader)).startswith(b"HTTP/1.1 400 ")
        writer.close()
