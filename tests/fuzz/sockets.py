"""Frames into the WebSockets, well formed and not."""

import asyncio
import base64
import contextlib
import json
import struct
from urllib.parse import quote, urlsplit

import websockets
from google.protobuf.json_format import ParseDict, ParseError
from websockets.exceptions import ConnectionClosed, InvalidStatus

from tests.fuzz.inputs import Inputs
from tests.fuzz.tally import Quota, Tally
from wayfarer.v1 import control_pb2

SURFACE = "WebSocket"
REQUEST = control_pb2.ControlRequest.DESCRIPTOR
BAD_CODES = {1011, 4500, 4503, 4504}
QUERIES = ("", "", "&fps=10", "&fps=nan", "&bones=hips", "&agent=%00", "&x=1")
VIEWPOINTS = '{"viewpoints": [{"position": {"x": 1.5, "y": 0, "z": -2e3}, "reach": 0.5}]}'
INTEREST = '{"rings": [{"radius": 9}, {"radius": 20, "format": {"encoding": 4}}], ' + VIEWPOINTS[1:]
FRAMES = 12
"""Maximum frames that are sent over one connection."""


async def worker(url: str, inputs: Inputs, quota: Quota, tally: Tally) -> None:
    """Send frames, one connection at a time, half of them well formed as WebSocket frames."""
    while quota.left > 0:
        if inputs.chance.random() < 0.7:
            await _messages(url, inputs, quota, tally)
        else:
            await _raw_frames(url, inputs, quota, tally)


async def _messages(url: str, inputs: Inputs, quota: Quota, tally: Tally) -> None:
    """Binary and text messages; the server may close at any of them, with a reason."""
    kind, sent, address = "extreme", [b""], _address(url, inputs)
    try:
        async with websockets.connect(
            address, compression=None, max_size=None, open_timeout=20
        ) as socket:
            if inputs.chance.random() < 0.8:
                await socket.send(_opening(inputs))
            for _ in range(inputs.chance.randrange(1, FRAMES)):
                if not await quota.take():
                    break
                kind, data = inputs.draw(REQUEST)
                sent[0] = data
                text = inputs.chance.random()
                if text < 0.1:
                    await socket.send(data.decode("latin-1"))
                else:
                    await socket.send(_nearly(inputs, VIEWPOINTS) if text < 0.2 else data)
                tally.answer(SURFACE, kind, "sent")
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(0.05):
                    await socket.recv()
    except ConnectionClosed as error:
        code = error.rcvd.code if error.rcvd else 1006
        _closed(tally, kind, code, sent[0])
    except InvalidStatus as error:
        answer = f"HTTP {error.response.status_code}"
        if error.response.status_code >= 500:
            tally.failure(SURFACE, kind, answer, "handshake", sent[0])
        else:
            tally.answer(SURFACE, kind, answer)
    except (OSError, TimeoutError) as error:
        tally.failure(SURFACE, kind, repr(error), address[:300], sent[0])


def _closed(tally: Tally, kind: str, code: int, data: bytes) -> None:
    if code in BAD_CODES:
        tally.failure(SURFACE, kind, f"closed {code}", "/v1/control", data)
    else:
        tally.answer(SURFACE, kind, f"closed {code}")


def _address(url: str, inputs: Inputs) -> str:
    session = quote(inputs.text("session_id"))
    extra = inputs.chance.choice(QUERIES)
    if inputs.chance.random() < 0.3:
        extra = f"&interest={quote(_nearly(inputs, INTEREST))}"
    path = inputs.chance.choice(("/v1/control", f"/v1/stream?session={session}{extra}"))
    return url.replace("http", "ws", 1) + path


def _nearly(inputs: Inputs, text: str) -> str:
    """The text as it is, or with a number or some bytes changed."""
    if inputs.chance.random() < 0.3:
        return text
    if inputs.chance.random() < 0.5:
        odd = inputs.chance.choice(("1e400", "-1", "null", "NaN", "[]", '"9"', "1e-300"))
        return text.replace(inputs.chance.choice(("9", "1.5", "-2e3", "0.5", "0")), odd)
    return inputs.mutate(text.encode()).decode("latin-1")


def _opening(inputs: Inputs) -> bytes:
    request = control_pb2.ControlRequest()
    request.open.session_id = inputs.text("session_id")
    if inputs.chance.random() < 0.3:
        with contextlib.suppress(ParseError):
            ParseDict(json.loads(INTEREST), request.open.interest)
        if inputs.chance.random() < 0.5:
            return inputs.mutate(request.SerializeToString())
    return request.SerializeToString()


async def _raw_frames(url: str, inputs: Inputs, quota: Quota, tally: Tally) -> None:
    """A sound handshake, then frames that break RFC 6455: the server may only hang up."""
    where = urlsplit(url)
    with contextlib.suppress(OSError, TimeoutError, EOFError):
        async with asyncio.timeout(5):
            reader, writer = await asyncio.open_connection(where.hostname, where.port)
            try:
                writer.write(_handshake(where.netloc, inputs))
                head = await reader.readuntil(b"\r\n\r\n")
                if b" 101 " not in head.split(b"\r\n", 1)[0]:
                    return
                for _ in range(inputs.chance.randrange(1, FRAMES)):
                    if not await quota.take():
                        break
                    writer.write(_frame(inputs))
                    await writer.drain()
                    tally.answer(SURFACE, "random", "raw frame")
                writer.write_eof()
                await reader.read(1 << 16)
            finally:
                writer.close()


def _handshake(host: str, inputs: Inputs) -> bytes:
    key = base64.b64encode(inputs.chance.randbytes(16)).decode()
    return (
        f"GET /v1/control HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n"
    ).encode()


def _frame(inputs: Inputs) -> bytes:
    """Any opcode and flags, masked or not, with a length that may be a lie."""
    chance = inputs.chance
    payload = inputs.draw(REQUEST)[1][: chance.choice((0, 10, 125, 126, 70_000))]
    first = chance.choice((0x82, 0x81, 0x02, 0x80, 0x88, 0x89, 0xF2, 0x83, chance.randrange(256)))
    masked = 0x80 if chance.random() < 0.8 else 0
    said = chance.choice((len(payload), len(payload), len(payload) + 1, 2**31, 2**63))
    if said < 126:
        head = struct.pack("!BB", first, masked | said)
    elif said < 2**16:
        head = struct.pack("!BBH", first, masked | 126, said)
    else:
        head = struct.pack("!BBQ", first, masked | 127, said)
    return head + (b"\0\0\0\0" if masked else b"") + payload
