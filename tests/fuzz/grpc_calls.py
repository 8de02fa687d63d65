"""Raw bytes into every gRPC method, and raw bytes into its port."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Iterable
from dataclasses import dataclass

import grpc
from google.protobuf.descriptor import MethodDescriptor

from tests.fuzz.inputs import Inputs
from tests.fuzz.tally import Quota, Tally
from wayfarer.transport.contract import FILES

SURFACE = "gRPC"
PORT_SURFACE = "gRPC port"
LEFT_OUT = {"wayfarer.v1.AdminService.Drain"}  # it would end the server, as it should
BAD = {"INTERNAL", "UNKNOWN", "DATA_LOSS", "UNAVAILABLE", "DEADLINE_EXCEEDED", "UNIMPLEMENTED"}
FROM_CLIENT = "Internal error from Core"
"""Text of grpcio's client when a stream ends before everything has been written to it; the server's
status is then lost."""

SECONDS = 20.0
"""Seconds after which a call without an answer counts as hanging."""

MESSAGES = 3
"""Messages that are read from a stream before it is dropped."""

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
EMPTY_SETTINGS = b"\x00\x00\x00\x04\x00\x00\x00\x00\x00"


@dataclass(frozen=True)
class Method:
    """A method of the project's services."""

    descriptor: MethodDescriptor

    @property
    def path(self) -> str:
        return f"/{self.descriptor.containing_service.full_name}/{self.descriptor.name}"


def methods() -> list[Method]:
    """All methods except those that would end the server."""
    services = [s for file in FILES for s in file.DESCRIPTOR.services_by_name.values()]
    found = [Method(method) for service in services for method in service.methods]
    return [method for method in found if method.descriptor.full_name not in LEFT_OUT]


async def worker(channel: grpc.aio.Channel, inputs: Inputs, quota: Quota, tally: Tally) -> None:
    """Send inputs, one call at a time."""
    known = methods()
    while await quota.take():
        method = inputs.chance.choice(known)
        descriptor = method.descriptor
        pieces = 1
        if descriptor.client_streaming:
            pieces = inputs.chance.choice((0, 1, 2, 5))
        drawn = [inputs.draw(descriptor.input_type) for _ in range(pieces)]
        kind = drawn[-1][0] if drawn else "empty"
        answer, details = await _call(channel, method, [data for _, data in drawn])
        if answer in BAD:
            target = f"{method.path} {details!r}"
            tally.failure(SURFACE, kind, answer, target, b"".join(data for _, data in drawn))
        else:
            tally.answer(SURFACE, kind, answer)


async def _call(channel: grpc.aio.Channel, method: Method, pieces: list[bytes]) -> tuple[str, str]:
    """Name and text of the status; also OK if the stream was dropped."""
    incoming, outgoing = method.descriptor.client_streaming, method.descriptor.server_streaming
    try:
        if incoming and not outgoing:
            await channel.stream_unary(method.path)(_each(pieces), timeout=SECONDS)
        elif not outgoing:
            await channel.unary_unary(method.path)(pieces[0], timeout=SECONDS)
        elif incoming:
            await _read(channel.stream_stream(method.path)(_each(pieces), timeout=SECONDS))
        else:
            await _read(channel.unary_stream(method.path)(pieces[0], timeout=SECONDS))
    except grpc.aio.AioRpcError as error:
        if error.details() == FROM_CLIENT:
            return "ended while it was written to", ""
        return error.code().name, error.details() or ""
    return "OK", ""


async def _read(call: grpc.aio.Call) -> None:
    try:
        async with asyncio.timeout(0.5):  # a stream of a session without agents has little to say
            for _ in range(MESSAGES):
                if await call.read() is grpc.aio.EOF:
                    return
    except TimeoutError:
        pass
    finally:
        call.cancel()


async def _each(pieces: Iterable[bytes]) -> AsyncIterator[bytes]:
    for piece in pieces:
        yield piece


async def port_worker(address: str, inputs: Inputs, quota: Quota, tally: Tally) -> None:
    """Sends bytes that are not gRPC, or only at first, to its port; the answer does not matter."""
    host, port = address.rsplit(":", 1)
    while await quota.take():
        begin = inputs.chance.choice((b"", PREFACE, PREFACE + EMPTY_SETTINGS))
        await _pour(host, int(port), begin + inputs.chance.randbytes(inputs.chance.randrange(400)))
        tally.answer(PORT_SURFACE, "random", "let go")


async def _pour(host: str, port: int, data: bytes) -> None:
    with contextlib.suppress(OSError, TimeoutError):
        async with asyncio.timeout(0.1):  # it may wait for the rest; others are waiting, too
            reader, writer = await asyncio.open_connection(host, port)
            try:
                writer.write(data)
                await writer.drain()
                writer.write_eof()
                await reader.read(1 << 16)
            finally:
                writer.close()
