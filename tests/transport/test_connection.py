"""What uvicorn's connections do to clients that dawdle or crowd."""

import asyncio
import contextlib

import pytest
import uvicorn

from wayfarer.transport.connection import HttpConnection, SocketConnection, common_name

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
    """What comes until the other end hangs up."""
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
