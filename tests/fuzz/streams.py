"""Readers that leave or stop reading, among healthy ones."""

import asyncio
import random
import socket
import struct
import time
from collections import defaultdict
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass, field
from urllib.parse import urlsplit

import grpc
import httpx

from wayfarer.v1 import (
    agent_pb2,
    common_pb2,
    control_pb2,
    control_pb2_grpc,
    goal_pb2,
    motion_pb2,
    motion_pb2_grpc,
    session_pb2,
)
from wayfarer_lab.load.target import Target
from wayfarer_lab.load.wire import Connection

SETTINGS = {
    "WAYFARER_ADMISSION": "false",
    "WAYFARER_CANDIDATES": "1",
    "WAYFARER_LIMITS__CALLS_PER_SECOND": "1000000",
    "WAYFARER_LIMITS__STREAMS": "80",
}
"""Settings of the server for these tests."""

AT_ONCE = 6
WARM_UP = 100
"""Cycles before memory is first measured."""

RECEIVE_BYTES = 4096
"""Receive buffer of a stalled reader's socket; the server keeps the rest, or drops it."""


@dataclass
class Reading:
    """Data that a healthy reader has received."""

    chunks: int = 0
    lost: int = 0  # by the sequence numbers
    lateness: list[float] = field(default_factory=list)  # seconds after the scheduled instant
    _next: dict[int, int] = field(default_factory=dict)

    def take(self, message: motion_pb2.StreamMotionResponse) -> None:
        """Count a message's chunks."""
        now = time.time()
        chunks = message.batch.chunks
        columns = chunks.aliases, chunks.seqs, chunks.scheduled_at_us
        for alias, seq, at in zip(*columns, strict=True):
            self.chunks += 1
            self.lost += seq - self._next.get(alias, seq)
            self._next[alias] = seq + 1
            self.lateness.append(now - 1e-6 * at)


@dataclass(frozen=True)
class Stall:
    """Effects of a stalled reader on the others."""

    readings: list[Reading]
    megabytes: tuple[float, float]  # memory of the server before and after
    stats: dict  # of the server, while it still stalls


async def people(connection: Connection, agents: int) -> str:
    """Makes a session of people on a long way."""
    made = await connection.sessions.CreateSession(session_pb2.CreateSessionRequest())
    session_id = str(made.session.session_id)
    specs = [agent_pb2.AgentSpec(gender=1 + i % 2, seed=i) for i in range(agents)]
    request = agent_pb2.CreateAgentsRequest(session_id=session_id, agents=specs)
    for agent in (await connection.agents.CreateAgents(request)).agents:
        goal = goal_pb2.Goal(position=common_pb2.Vector3(z=500.0))
        await connection.goals.SetGoal(goal_pb2.SetGoalRequest(agent_id=agent.agent_id, goal=goal))
    return session_id


async def stall(
    target: Target,
    seconds: float,
    sessions: int,
    agents: int,
    healthy: int,
    kind: str,
    warm_up: float = 0.0,
) -> Stall:
    """Stalls one reader of the first session; `healthy` others read it and the other sessions.

    The first session has four times as many agents, so that the unread motion fills all buffers.
    `warm_up`: seconds that the others read before, so that the server's memory settles.
    """
    connection = Connection(target)
    names = [await people(connection, agents if i else 4 * agents) for i in range(sessions)]
    readings = [Reading() for _ in range(healthy)]
    reading = [
        asyncio.create_task(_read(connection, names[(number + 1) % sessions], own))
        for number, own in enumerate(readings)
    ]
    await asyncio.sleep(warm_up)
    before = target.resident_megabytes() or 0.0
    stalled = await STALLS[kind](target, names[0])
    await asyncio.sleep(seconds)
    stats = await stats_of(target)
    after = target.resident_megabytes() or 0.0
    for task in reading:
        assert not task.done(), task
        task.cancel()
    await asyncio.wait(reading)
    await stalled()
    await connection.close()
    return Stall(readings, (before, after), stats)


async def _read(connection: Connection, session_id: str, reading: Reading) -> None:
    async for message in connection.stream(session_id, "grpc"):
        reading.take(message)


async def _stalled_grpc(target: Target, session_id: str) -> Callable[[], Awaitable[None]]:
    channel = grpc.aio.insecure_channel(
        target.grpc, options=[("grpc.http2.lookahead_bytes", RECEIVE_BYTES)]
    )
    request = motion_pb2.StreamMotionRequest(session_id=session_id)
    request.format.profile = motion_pb2.POSE_PROFILE_FULL
    call = motion_pb2_grpc.MotionServiceStub(channel).StreamMotion(request)
    await call.read()
    return channel.close


async def _stalled_socket(target: Target, session_id: str) -> Callable[[], Awaitable[None]]:
    where = urlsplit(target.http)
    raw = socket.socket()
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
    raw.setblocking(False)
    loop = asyncio.get_running_loop()
    await loop.sock_connect(raw, (where.hostname, where.port))
    await loop.sock_sendall(raw, handshake(where.netloc, f"{session_id}&profile=full"))
    head = await loop.sock_recv(raw, 200)
    assert b" 101 " in head, head

    async def close() -> None:
        raw.close()

    return close


STALLS = {"grpc": _stalled_grpc, "websocket": _stalled_socket}


async def cycles(target: Target, count: int, seed: int) -> tuple[float, float, dict]:
    """Opens and leaves `count` streams in every possible way.

    Returns memory after the warm-up and at the end, MB, and the server's final figures.
    """
    chance = random.Random(seed)
    connection = Connection(target)
    session_id = await people(connection, 2)
    reading = Reading()
    following = asyncio.create_task(_read(connection, session_id, reading))
    await _leave(target, session_id, chance, WARM_UP)
    before = target.resident_megabytes() or 0.0
    await _leave(target, session_id, chance, count)
    async with asyncio.timeout(30):  # until all are seen to have gone
        while (stats := await stats_of(target))["subscribers"] > 1:
            await asyncio.sleep(0.1)
    after = target.resident_megabytes() or 0.0
    assert not following.done(), following
    assert reading.chunks and not reading.lost
    following.cancel()
    await asyncio.wait({following})
    await connection.close()
    return before, after, stats


async def _leave(target: Target, session_id: str, chance: random.Random, count: int) -> None:
    left = iter(range(count))

    async def worker() -> None:
        async with grpc.aio.insecure_channel(target.grpc) as channel:
            for _ in left:
                way = chance.choice((_leave_stream, _leave_stream, _leave_control, _leave_socket))
                await way(target, channel, session_id, chance)

    async with asyncio.TaskGroup() as tasks:
        for _ in range(AT_ONCE):
            tasks.create_task(worker())


async def _leave_stream(
    target: Target, channel: grpc.aio.Channel, session_id: str, chance: random.Random
) -> None:
    request = motion_pb2.StreamMotionRequest(session_id=session_id)
    call = motion_pb2_grpc.MotionServiceStub(channel).StreamMotion(request)
    await _give_up(call, chance)


async def _leave_control(
    target: Target, channel: grpc.aio.Channel, session_id: str, chance: random.Random
) -> None:
    call = control_pb2_grpc.ControlServiceStub(channel).Control()
    opening = control_pb2.ControlRequest(open=motion_pb2.StreamMotionRequest(session_id=session_id))
    with suppress(asyncio.CancelledError, grpc.aio.AioRpcError):
        await call.write(opening)
    await _give_up(call, chance)


async def _give_up(call: grpc.aio.Call, chance: random.Random) -> None:
    """Reads a little, or nothing, and leaves, with or without cancelling."""
    with suppress(grpc.aio.AioRpcError):
        for _ in range(chance.choice((0, 0, 1, 3))):
            message = await call.read()
            assert message is not grpc.aio.EOF
    call.cancel()


async def _leave_socket(
    target: Target, channel: grpc.aio.Channel, session_id: str, chance: random.Random
) -> None:
    """Makes half or all of a handshake and leaves, with FIN or RST."""
    where = urlsplit(target.http)
    request = handshake(where.netloc, session_id)
    with suppress(OSError):
        _, writer = await asyncio.open_connection(where.hostname, where.port)
        writer.write(request[: chance.choice((40, len(request), len(request)))])
        await writer.drain()
        await asyncio.sleep(chance.choice((0, 0, 0.02, 0.3)))
        if chance.random() < 0.5:
            linger = struct.pack("ii", 1, 0)  # RST instead of FIN
            writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        writer.close()
        await writer.wait_closed()


def handshake(host: str, query: str) -> bytes:
    """The request that opens `WS /v1/stream`; `query` begins with the session."""
    return (
        f"GET /v1/stream?session={query} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        "Sec-WebSocket-Version: 13\r\n\r\n"
    ).encode()


async def stats_of(target: Target) -> dict:
    """`GET /v1/stats`."""
    async with httpx.AsyncClient(timeout=30) as http:
        answer = await http.get(f"{target.http}/v1/stats")
        answer.raise_for_status()
        return dict(answer.json())


def summary(stall: Stall) -> dict:
    """Figures for people, lateness in ms."""
    late = sorted(1e3 * value for reading in stall.readings for value in reading.lateness)
    at = defaultdict(float, {p: late[int(p / 100 * (len(late) - 1))] for p in (50, 99, 100)})
    return {
        "readers": len(stall.readings),
        "chunks": sum(reading.chunks for reading in stall.readings),
        "lost": sum(reading.lost for reading in stall.readings),
        "lateness_ms": {f"p{p}": round(at[p], 1) for p in (50, 99, 100)},
        "megabytes": [round(megabytes, 1) for megabytes in stall.megabytes],
        "late_chunks": stall.stats["late_chunks"],
        "dropped": stall.stats["dropped_batches"],
    }
