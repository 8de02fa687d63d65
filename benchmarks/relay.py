"""Cost of the front of `serve --workers N`: CPU time per relayed message.

    python -m benchmarks.relay [MESSAGES]

A stand-in for a worker sends messages of the sizes that streams have, as fast as they are taken,
and one reader takes them through the front. CPU is that of the front's process, user and system;
the machine may be busy with other work.
"""

import asyncio
import sys
import time
from asyncio.subprocess import PIPE, Process
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import grpc
import uvicorn
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute

from wayfarer.transport.connection import HttpConnection, SocketConnection
from wayfarer.workers.grpc_relay import GrpcRelay
from wayfarer.workers.messages import Report
from wayfarer.workers.placement import Placement
from wayfarer.workers.socket_relay import SocketRelay

SIZES: Final = (3_000, 24_000, 190_000)
"""Bytes: one agent's chunk, 8 and 64 of them (float32, all bones)."""


class OneWorker:
    """The only one."""

    report = Report(alive=True, ready=True, started=True)


async def measure(folder: Path, messages: int) -> dict[str, float]:
    """CPU seconds of this process per message, by transport."""
    placement = Placement([OneWorker()])
    relay = GrpcRelay([folder / "grpc"], placement)
    server = grpc.aio.server()
    server.add_generic_rpc_handlers((relay,))
    ports = {"grpc": server.add_insecure_port("127.0.0.1:0")}
    await server.start()
    sockets = SocketRelay([folder / "http"], placement)
    http = uvicorn.Server(
        uvicorn.Config(
            Starlette(routes=[WebSocketRoute("/v1/stream", sockets.stream)]),
            port=0,
            log_level="error",
            lifespan="off",
            http=HttpConnection,
            ws=SocketConnection,
            ws_per_message_deflate=False,
        )
    )
    serving = asyncio.create_task(http.serve())
    while not http.started:
        await asyncio.sleep(0.01)
    ports["websocket"] = http.servers[0].sockets[0].getsockname()[1]
    found = {}
    for kind, port in ports.items():
        before = time.process_time()
        reader = await _end(kind, str(port))
        out, _ = await reader.communicate()
        assert int(out) == messages, out
        found[kind] = (time.process_time() - before) / messages
    http.should_exit = True
    await asyncio.gather(serving, server.stop(0), relay.close())
    return found


async def _end(*arguments: str) -> Process:
    return await asyncio.create_subprocess_exec(
        sys.executable, "-m", "benchmarks.relay_ends", *arguments, stdout=PIPE
    )


async def main(messages: int) -> None:
    """Print the table."""
    print("| bytes of a message | gRPC, µs | WebSocket, µs |\n|---|---|---|")
    for size in SIZES:
        with TemporaryDirectory() as folder:
            worker = await _end("worker", folder, str(size), str(messages))
            try:
                while not Path(folder, "http").exists():
                    await asyncio.sleep(0.05)
                cost = await measure(Path(folder), messages)
            finally:
                worker.kill()
                await worker.wait()
        print(f"| {size} | {1e6 * cost['grpc']:.0f} | {1e6 * cost['websocket']:.0f} |", flush=True)


if __name__ == "__main__":
    import uvloop

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(main(int(sys.argv[1]) if len(sys.argv) > 1 else 2_000))
