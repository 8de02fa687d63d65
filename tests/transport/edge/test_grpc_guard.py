"""The checks before the gRPC handlers, over a small service."""

import asyncio
import contextlib

import grpc
import pytest
from grpc_health.v1 import health, health_pb2, health_pb2_grpc
from structlog.contextvars import get_contextvars

from tests.transport.auth.test_keys import STUDIO
from tests.transport.edge.test_http_guard import guarded
from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument
from wayfarer.transport.edge.caller import current_caller
from wayfarer.transport.edge.grpc_guard import (
    OPEN_STREAMS,
    GuardInterceptor,
    OpenStreamsInterceptor,
    address,
)
from wayfarer.transport.edge.guard import Guard
from wayfarer.transport.edge.metrics import Metrics
from wayfarer.transport.edge.tracing import Tracing
from wayfarer.transport.grpc_server import GrpcServer

KEY = (("x-api-key", STUDIO),)


class Handlers:
    """Every kind of call; each returns its caller."""

    async def unary(self, request: bytes, context) -> bytes:
        if request == b"bad":
            raise InvalidArgument("bad", "request")
        return f"{current_caller().name} {get_contextvars()['request_id']}".encode()

    async def stream(self, request: bytes, context):
        for _ in range(2):
            yield current_caller().name.encode()
        if request == b"wait":
            await asyncio.sleep(60)

    async def collect(self, requests, context) -> bytes:
        return b"".join([request async for request in requests]) + current_caller().name.encode()

    async def both(self, requests, context):
        async for request in requests:
            yield request + current_caller().name.encode()


class Rig:
    def __init__(self, guard: Guard) -> None:
        self.metrics = Metrics()
        handlers = Handlers()
        own = {
            "Unary": grpc.unary_unary_rpc_method_handler(handlers.unary),
            "Stream": grpc.unary_stream_rpc_method_handler(handlers.stream),
            "Collect": grpc.stream_unary_rpc_method_handler(handlers.collect),
            "Both": grpc.stream_stream_rpc_method_handler(handlers.both),
        }
        interceptors = [
            OpenStreamsInterceptor(),
            GuardInterceptor(guard, self.metrics, Tracing(), access_log=True),
        ]
        self.server = grpc.aio.server(interceptors=interceptors)
        self.server.add_generic_rpc_handlers(
            (grpc.method_handlers_generic_handler("wayfarer.Test", own),)
        )
        self.health = health.aio.HealthServicer()
        health_pb2_grpc.add_HealthServicer_to_server(self.health, self.server)
        self.port = self.server.add_insecure_port("127.0.0.1:0")

    def count(self, name: str, **labels: str) -> float | None:
        return self.metrics.registry.get_sample_value(name, labels)


@contextlib.asynccontextmanager
async def running(guard: Guard):
    rig = Rig(guard)
    await rig.server.start()
    async with grpc.aio.insecure_channel(f"127.0.0.1:{rig.port}") as rig.channel:
        yield rig
    await rig.server.stop(0)


@pytest.fixture
async def rig(tmp_path):
    async with running(guarded(tmp_path)) as rig:
        yield rig


async def test_a_key_opens_every_kind_of_call(rig):
    answer = await rig.channel.unary_unary("/wayfarer.Test/Unary")(
        b"", metadata=(*KEY, ("x-request-id", "walk-1"))
    )
    assert answer == b"key:studio walk-1"
    bearer = (("authorization", f"Bearer {STUDIO}"),)
    streamed = rig.channel.unary_stream("/wayfarer.Test/Stream")(b"", metadata=bearer)
    assert [m async for m in streamed] == [b"key:studio"] * 2
    collected = rig.channel.stream_unary("/wayfarer.Test/Collect")(iter([b"a", b"b"]), metadata=KEY)
    assert await collected == b"abkey:studio"
    both = rig.channel.stream_stream("/wayfarer.Test/Both")(iter([b"a"]), metadata=KEY)
    assert [m async for m in both] == [b"akey:studio"]


@pytest.mark.parametrize("metadata", [(), (("x-api-key", "wf_wrong"),), (("authorization", "x"),)])
@pytest.mark.parametrize("kind", ["Unary", "Stream"])
async def test_without_a_key_that_holds(rig, metadata, kind):
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        if kind == "Unary":
            await rig.channel.unary_unary("/wayfarer.Test/Unary")(b"", metadata=metadata)
        else:
            call = rig.channel.unary_stream("/wayfarer.Test/Stream")(b"", metadata=metadata)
            async for _ in call:
                pass
    assert caught.value.code() == grpc.StatusCode.UNAUTHENTICATED
    assert "wf_wrong" not in caught.value.details()


async def test_too_many_calls(tmp_path):
    async with running(guarded(tmp_path, per_second=1)) as rig:
        call = rig.channel.unary_unary("/wayfarer.Test/Unary")
        for _ in range(2):
            await call(b"", metadata=KEY)
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await call(b"", metadata=KEY)
    assert caught.value.code() == grpc.StatusCode.RESOURCE_EXHAUSTED


async def test_calls_are_timed_and_ends_of_streams_counted(rig):
    call = rig.channel.unary_unary("/wayfarer.Test/Unary")
    await call(b"", metadata=KEY)
    for request, metadata in ((b"bad", KEY), (b"", ())):
        with pytest.raises(grpc.aio.AioRpcError):
            await call(request, metadata=metadata)
    streamed = rig.channel.unary_stream("/wayfarer.Test/Stream")(b"wait", metadata=KEY)
    await streamed.read()
    streamed.cancel()

    def timed(code: str) -> float | None:
        return rig.count("wayfarer_rpc_seconds_count", method="/wayfarer.Test/Unary", code=code)

    assert [timed(c) for c in ("OK", "INVALID_ARGUMENT", "UNAUTHENTICATED")] == [1, 1, 1]
    async with asyncio.timeout(5):
        ended = {"method": "/wayfarer.Test/Stream", "code": "CANCELLED"}
        while rig.count("wayfarer_stream_ends_total", **ended) != 1:
            await asyncio.sleep(0.01)


async def test_health_is_open_but_not_to_be_hoarded(rig):
    stub = health_pb2_grpc.HealthStub(rig.channel)
    assert await stub.Check(health_pb2.HealthCheckRequest())
    held = [stub.Watch(health_pb2.HealthCheckRequest()) for _ in range(OPEN_STREAMS)]
    for watch in held:
        await watch.read()
    one_more = stub.Watch(health_pb2.HealthCheckRequest())
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await one_more.read()
    assert caught.value.code() == grpc.StatusCode.RESOURCE_EXHAUSTED
    held.pop().cancel()
    async with asyncio.timeout(5):
        while True:
            try:
                assert await stub.Watch(health_pb2.HealthCheckRequest()).read()
                break
            except grpc.aio.AioRpcError:
                await asyncio.sleep(0.02)
    assert await stub.Check(health_pb2.HealthCheckRequest())


@pytest.mark.parametrize(
    ("peer", "expected"),
    [
        ("ipv4:10.0.0.1:4711", "10.0.0.1"),
        ("ipv6:%5B::1%5D:4711", "[::1]"),
        ("unix:/run/x", "/run/x"),
    ],
)
def test_address(peer, expected):
    assert address(peer) == expected


async def test_beyond_the_limit_connections_are_closed_and_room_comes_back():
    server = GrpcServer(lambda _: None, Limits(), "127.0.0.1", 0, connections=2)
    await server.start()

    def connect() -> grpc.aio.Channel:
        own = [("grpc.use_local_subchannel_pool", 1)]  # otherwise channels share a connection
        return grpc.aio.insecure_channel(f"127.0.0.1:{server.port}", options=own)

    async def answers(channel: grpc.aio.Channel) -> bool:
        request = health_pb2.HealthCheckRequest()
        try:
            await health_pb2_grpc.HealthStub(channel).Check(request, timeout=10)
        except grpc.aio.AioRpcError as error:
            assert error.code() is grpc.StatusCode.UNAVAILABLE
            return False
        return True

    first, second, third = (connect() for _ in range(3))
    assert [await answers(channel) for channel in (first, second, third)] == [True, True, False]
    await first.close()
    async with asyncio.timeout(10):
        while not await answers(third):
            await asyncio.sleep(0.1)
    assert await answers(second)
    for channel in (second, third):
        await channel.close()
    await server.stop(0)
