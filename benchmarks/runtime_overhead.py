"""CPU time of each part of the service except the engine, per 0.2 s of real time.

    python -m benchmarks.runtime_overhead [--agents 1024] [--sessions 8] [--candidates 1]
        [--batch 256] [--phases 4] [--steps 25] [--json FILE] [--quick]

World, streams and servers are those of the service, with walking agents; the engine is a stand-in
that returns at once. Time advances by hand in steps of 0.2 s, so that the figures do not depend on
whether this machine keeps up. It runs three times: without readers (*nobody*), with one reader per
session over gRPC, and over WebSocket; the readers are another process and discard what they get.
*world* is the work of the motion thread: stepping, sending and publishing. *transport* is the
rest: the event loop, and gRPC's own threads. Parts are measured around calls, inner ones included.
"""

import argparse
import asyncio
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from benchmarks import bench
from benchmarks.bench import Row
from benchmarks.driven import Driven, InstantEngine
from wayfarer.body.library import SHIPPED
from wayfarer.config.limits import Limits
from wayfarer.process.event_loop import run
from wayfarer.runtime.streams.publisher import Publisher
from wayfarer.runtime.streams.subscription import Subscription
from wayfarer.spec import GENDERS, STEP_SECONDS
from wayfarer.transport import schema
from wayfarer.transport.codec import PoseEncoder
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.server import Server
from wayfarer.transport.streams.batches import BatchWriter
from wayfarer.world import sending
from wayfarer.world.goals.steering import Steering
from wayfarer.world.stepping import batch, playback, scheduler
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.world import World

PARTS: Final = (
    (World, "step", "world: step"),
    (scheduler.Scheduler, "schedule", "  schedule"),
    (Steering, "decide", "    decide"),
    (scheduler, "gather", "    gather"),
    (batch, "latents", "      noise"),
    (scheduler, "pad", "  pad"),
    (InstantEngine, "step", "  engine (a stand-in)"),
    (scheduler.Scheduler, "apply", "  apply"),
    (scheduler, "corrected", "    corrections"),
    (World, "take_due", "world: send"),
    (playback.Playback, "send", "  take out of playback"),
    (sending, "due_by_session", "  part by session"),
    (Publisher, "publish", "world: publish"),
    (World, "next_event", "world: find the next event"),
    (Subscription, "put", "transport: queue"),
    (Subscription, "_next", "transport: take and mark"),
    (BatchWriter, "batch", "transport: write"),
    (PoseEncoder, "encode", "  encode poses"),
)
"""Owner, function, and name in the table; indented parts are within the part above."""


GRPC_READER: Final = """
import asyncio, grpc, sys
from wayfarer.v1 import motion_pb2
async def read(session):
    size = [("grpc.max_receive_message_length", 1 << 28), ("grpc.use_local_subchannel_pool", 1)]
    async with grpc.aio.insecure_channel(sys.argv[1], options=size) as channel:
        stream = channel.unary_stream(
            "/wayfarer.v1.MotionService/StreamMotion",
            motion_pb2.StreamMotionRequest.SerializeToString,
        )
        async for _ in stream(motion_pb2.StreamMotionRequest(session_id=session)):
            pass
async def main():
    await asyncio.gather(*map(read, sys.argv[2:]), return_exceptions=True)
asyncio.run(main())
"""
WEBSOCKET_READER: Final = """
import asyncio, sys, websockets
async def read(session):
    url = f"{sys.argv[1].replace('http', 'ws')}/v1/stream?session={session}"
    async with websockets.connect(url, max_size=None, compression=None) as socket:
        async for _ in socket:
            pass
async def main():
    await asyncio.gather(*map(read, sys.argv[2:]), return_exceptions=True)
asyncio.run(main())
"""


class Clocked:
    """Sums the CPU time of named functions on whichever thread they run."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self.calls: Counter[str] = Counter()

    def clear(self) -> None:
        """Reset the counts."""
        self.seconds.clear()
        self.calls.clear()

    def wrap(self, owner: Any, attribute: str, name: str) -> None:
        """Time every call of `owner.attribute` from now on."""
        call: Callable[..., Any] = getattr(owner, attribute)

        def timed(*args: Any, **kwargs: Any) -> Any:
            started = time.thread_time()
            try:
                return call(*args, **kwargs)
            finally:
                self.seconds[name] += time.thread_time() - started
                self.calls[name] += 1

        setattr(owner, attribute, timed)


async def measure(asked: argparse.Namespace, reader: str, clocked: Clocked) -> list[Row]:
    """CPU ms per 0.2 s of every part, while "nobody", "grpc" or "websocket" reads."""
    service = Driven(asked)
    limits = Limits(
        agents=asked.agents,
        agents_per_session=asked.agents,
        sessions=asked.sessions,
        lease_s=3600,
    )
    gateway = Gateway(service, BodyLibrary(SHIPPED), limits, time.time, lambda: None)  # type: ignore[arg-type]
    server = Server(gateway, "127.0.0.1", 0, 0)
    await server.start()
    await server.until_ready()
    sessions = [await people(gateway, asked) for _ in range(asked.sessions)]
    code, address = {
        "grpc": (GRPC_READER, server.grpc_address),
        "websocket": (WEBSOCKET_READER, server.http_url),
        "nobody": ("", ""),
    }[reader]
    readers = subprocess.Popen([sys.executable, "-c", code, address, *sessions]) if code else None
    try:
        while readers and len(service.subscriptions) < len(sessions):
            await asyncio.sleep(0.05)
        await service.advance(5 * STEP_SECONDS)  # every agent has been introduced
        await drained(service)
        clocked.clear()
        began = time.process_time()
        world = await service.advance(asked.steps * STEP_SECONDS)
        await drained(service)
        spent = {"world": world, "transport": time.process_time() - began - world}
    finally:
        if readers:
            readers.terminate()
            readers.wait()
        await server.stop()
    row = partial(_row, reader, asked.steps)
    rows = [row(name, seconds) for name, seconds in spent.items()]
    names = [name for *_, name in PARTS if clocked.calls[name]]
    return [*rows, *(row(name, clocked.seconds[name], clocked.calls[name]) for name in names)]


async def people(gateway: Gateway, asked: argparse.Namespace) -> str:
    """Makes a session with its share of the agents; returns its id."""
    session_id = (await gateway.sessions.create(schema.NewSession(lease_s=3600))).session_id
    each = asked.agents // asked.sessions
    for start in range(0, each, 64):
        specs = [schema.AgentSpec(gender=GENDERS[i % 2], seed=i) for i in range(start, start + 64)]
        new = schema.NewAgents(agents=specs[: each - start])
        await gateway.agents.create(session_id, new)
    return session_id


async def drained(service: Driven) -> None:
    """Returns when all readers have taken everything."""
    await asyncio.sleep(0.5)
    while any(reader._waiting for reader in service.subscriptions):
        await asyncio.sleep(0.1)


def _row(reader: str, steps: int, part: str, seconds: float, calls: int = 0) -> Row:
    return {
        "reader": reader,
        "part": part,
        "ms": 1e3 * seconds / steps,
        "calls": calls / steps if calls else None,
    }


def main() -> None:
    """Measures and prints."""
    parser = bench.parser(__doc__)
    parser.add_argument("--agents", type=int, default=1024)
    parser.add_argument("--sessions", type=int, default=8)
    parser.add_argument("--candidates", type=int, default=1)
    parser.add_argument("--batch", type=int, default=256, help="largest batch, a power of two")
    parser.add_argument("--phases", type=int, default=WorldSettings().phases)
    parser.add_argument("--steps", type=int, help="of 0.2 s")
    parser.add_argument("--readers", nargs="+", default=["nobody", "grpc", "websocket"])
    asked: argparse.Namespace = parser.parse_args()
    asked.steps = asked.steps or (10 if asked.quick else 25)
    clocked = Clocked()
    for part in PARTS:
        clocked.wrap(*part)
    rows = []
    for reader in asked.readers:
        rows += run(measure(asked, reader, clocked))
    bench.finish(asked, rows, agents=asked.agents, sessions=asked.sessions)


if __name__ == "__main__":
    main()
