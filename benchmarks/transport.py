"""Cost of sending for the server: 1,024 agents to one client, over gRPC and over WebSocket.

    python -m benchmarks.transport [--agents 1024] [--seconds 20] [--json FILE] [--quick]

The server's step is a stand-in that costs nothing (benchmarks.instant), and all agents stand. Cores
are CPU seconds of the whole server for each second. *nobody* is the server without readers; a
reader adds serialisation and transport. *bare socket* is the floor: the same bytes in messages of
the same size through asyncio and a loopback socket, without any processing.
"""

import argparse
import asyncio
import sys
import time
from contextlib import AbstractAsyncContextManager, suppress

from benchmarks import bench
from benchmarks.bench import Row
from benchmarks.models import DEFAULT_ENGINE
from benchmarks.servers import settings
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer_lab.load.client import SimulatedClient
from wayfarer_lab.load.plan import TRANSPORTS, LoadPlan
from wayfarer_lab.load.run import run
from wayfarer_lab.load.tally import Tally
from wayfarer_lab.load.target import Target, own_server

INSTANT = ("-m", "benchmarks.instant")
SETTLE = 3.0
MESSAGES_PER_SECOND = WorldSettings().phases / STEP_SECONDS
"""Number of phases of the 0.2 s in which chunks are due."""


async def measure(agents: int, seconds: float) -> list[Row]:
    """Rows for nobody, each transport, and the bare socket."""
    quiet = LoadPlan(1, agents, seconds, SETTLE, goal_rate=0.0)
    async with _server(quiet) as target:
        alone = await _unread(target, quiet)
    rows = [_row("nobody", alone, 0.0, alone)]
    for transport in TRANSPORTS:
        plan = LoadPlan(1, agents, seconds, SETTLE, transport, goal_rate=0.0)
        async with _server(plan) as target:
            summary, _ = await run(target, plan)
        if summary["misses"]:  # not everything was sent
            raise SystemExit(
                f"{summary['misses']} of the primitives did not come in time over {transport}, "
                "though the engine does nothing: is the machine busy with something else?"
            )
        rate = summary["megabytes"] / seconds
        row = _row(transport, summary["cpu"]["server"], rate, alone)
        rows.append(row | {"generator": summary["cpu"]["generator"]})
    rate = max(row["mb_per_s"] for row in rows)
    floor = await bare_socket(round(1e6 * rate / MESSAGES_PER_SECOND), seconds)
    rows.append(_row("bare socket", floor, rate, 0.0))
    return rows


def _server(plan: LoadPlan) -> AbstractAsyncContextManager[Target]:
    return own_server((), settings(plan, candidates=1, engine=DEFAULT_ENGINE), INSTANT)


def _row(reader: str, cores: float, rate: float, alone: float) -> Row:
    return {
        "reader": reader,
        "server_cores": cores,
        "sending_cores": cores - alone,
        "mb_per_s": rate,
        "generator": None,
    }


async def _unread(target: Target, plan: LoadPlan) -> float:
    """Cores of a server without streams."""
    client = SimulatedClient(target, plan, Tally(), 0)
    await client.open()
    await asyncio.sleep(SETTLE)
    began, before = time.monotonic(), target.cpu_seconds() or 0.0
    await asyncio.sleep(plan.seconds)
    cores = ((target.cpu_seconds() or 0.0) - before) / (time.monotonic() - began)
    await client.close()
    return cores


async def bare_socket(size: int, seconds: float) -> float:
    """Cores of a writer of messages of `size` bytes; its reader is a separate process."""
    reader = "import socket, sys\ns = socket.create_connection(('127.0.0.1', int(sys.argv[1])))\n"
    reader += "while s.recv(1 << 20): pass\n"
    cores: asyncio.Future[float] = asyncio.get_running_loop().create_future()

    async def write(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        message = bytes(size)
        began, before = time.monotonic(), time.process_time()
        for number in range(round(seconds * MESSAGES_PER_SECOND)):
            writer.write(message)
            await writer.drain()
            due = began + number / MESSAGES_PER_SECOND
            await asyncio.sleep(max(due - time.monotonic(), 0.0))
        cores.set_result((time.process_time() - before) / (time.monotonic() - began))
        writer.close()

    async with await asyncio.start_server(write, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        child = await asyncio.create_subprocess_exec(sys.executable, "-c", reader, str(port))
        found = await cores
        with suppress(ProcessLookupError):
            await child.wait()
    return found


def main() -> None:
    """Measures and prints."""
    parser = bench.parser(__doc__)
    parser.add_argument("--agents", type=int, default=1024)
    parser.add_argument("--seconds", type=float)
    asked: argparse.Namespace = parser.parse_args()
    seconds = asked.seconds or (5.0 if asked.quick else 20.0)
    rows = asyncio.run(measure(asked.agents, seconds))
    alone = rows[0]["server_cores"]
    ratios = {
        f"server with a reader over {row['reader']} / without": bench.ratio(
            row["server_cores"] / alone, "lower"
        )
        for row in rows
        if row["reader"] in TRANSPORTS
    }
    bench.finish(asked, rows, agents=asked.agents, ratios=ratios)


if __name__ == "__main__":
    main()
