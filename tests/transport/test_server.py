"""Properties of both transports: the same answers, health, shutdown, ports."""

import asyncio
import contextlib
import socket

import grpc
import pytest
import websockets
from grpc_health.v1 import health_pb2

from tests.transport.fakes import gateway
from wayfarer.errors import Unavailable
from wayfarer.transport.server import Server
from wayfarer.v1 import (
    motion_pb2,
    session_pb2,
)

SERVING = health_pb2.HealthCheckResponse.SERVING
NOT_SERVING = health_pb2.HealthCheckResponse.NOT_SERVING


async def test_both_transports_send_the_same_messages(rig):
    session_id, _ = await rig.session()
    call = rig.motion.StreamMotion(motion_pb2.StreamMotionRequest(session_id=session_id))
    async with rig.socket(session_id) as socket:
        pairs = []
        for _ in range(3):
            by_grpc = await call.read()
            by_socket = motion_pb2.StreamMotionResponse.FromString(await socket.recv())
            pairs.append((by_grpc, by_socket))
            rig.service.emit(session_id)
    call.cancel()
    assert all(a == b for a, b in pairs)


@pytest.mark.parametrize("bad", ["NaN", "Infinity", "-Infinity", "1e400"])
async def test_json_numbers_that_are_none_are_refused_with_their_field(rig, bad):
    answer = await rig.http.put(
        "/v1/agents/x/goal",
        content=f'{{"position": {{"x": {bad}, "y": 0, "z": 0}}}}',
        headers={"content-type": "application/json"},
    )
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["errors"][0]["field"] == "position.x"


async def test_an_unforeseen_error_stays_inside(rig):
    session_id, _ = await rig.session()
    rig.service.fail_with = ZeroDivisionError("secret")
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await rig.sessions.GetSession(session_pb2.GetSessionRequest(session_id=session_id))
    assert caught.value.code() == grpc.StatusCode.INTERNAL
    assert "secret" not in caught.value.details()
    rig.service.fail_with = ZeroDivisionError("secret")
    answer = await rig.http.get(f"/v1/sessions/{session_id}")
    assert answer.status_code == 500 and "secret" not in answer.text
    assert (await rig.http.get(f"/v1/sessions/{session_id}")).status_code == 200


async def grpc_health(rig, service: str = "") -> int:
    return (await rig.health.Check(health_pb2.HealthCheckRequest(service=service))).status


async def test_health_follows_the_runtime(rig):
    assert await grpc_health(rig) == await grpc_health(rig, "wayfarer.v1.MotionService") == SERVING
    assert (await rig.http.get("/v1/health/ready")).json() == {"status": "ready"}
    rig.service.ready = False
    assert (await rig.http.get("/v1/health/ready")).status_code == 503
    assert (await rig.http.get("/v1/health/live")).status_code == 200
    async with asyncio.timeout(10):
        while await grpc_health(rig) == SERVING:
            await asyncio.sleep(0.05)
    rig.service.alive = False
    assert (await rig.http.get("/v1/health/live")).status_code == 503
    rig.service.ready = rig.service.alive = True
    async with asyncio.timeout(10):
        while await grpc_health(rig, "wayfarer.v1.MotionService") == NOT_SERVING:
            await asyncio.sleep(0.05)


async def test_stop_ends_streams_with_a_reason(rig):
    session_id, _ = await rig.session()
    call = rig.motion.StreamMotion(motion_pb2.StreamMotionRequest(session_id=session_id))
    await call.read()
    async with rig.socket(session_id) as socket:
        await socket.recv()
        await rig.stop()
        with pytest.raises(websockets.ConnectionClosed) as closed:
            while True:
                await socket.recv()
    assert closed.value.rcvd.code == 4503
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        while await call.read() is not grpc.aio.EOF:
            pass
    assert caught.value.code() == grpc.StatusCode.UNAVAILABLE
    assert "shutting down" in caught.value.details()
    assert all(s.closed for s in rig.service.subscriptions)


async def test_a_port_in_use_is_one_clear_line():
    api = gateway()
    with contextlib.closing(socket.create_server(("127.0.0.1", 0))) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(Unavailable, match=rf"HTTP on 127.0.0.1:{port}: .*in use.*--http-port"):
            Server(api, "127.0.0.1", port, 0)
        with pytest.raises(Unavailable, match=rf"gRPC on 127.0.0.1:{port}: .*in use.*--grpc-port"):
            Server(api, "127.0.0.1", 0, port)
