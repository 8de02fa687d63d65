"""Whether frames are lost when connections break: cut at random instants, resumed, counted.

    python -m tests.clients.resume_stress [--cuts 100] [--agents 16] [--busy 4] [--seed 0]

starts a server, a relay before it that resets each connection after a random time, and readers:
the Python client over gRPC and the web client over WebSocket (Node). Each counts the sequence
numbers of every agent's chunks. `--busy`: processes that only burn CPU meanwhile.
"""

import argparse
import asyncio
import json
import multiprocessing
import random
import socket
import struct
import sys
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

import wayfarer_client as wf
from tests.serving import Service

READER = Path(__file__).parents[2] / "clients" / "web" / "test" / "resume.js"
PATIENCE = 600.0


class Counted:
    """Sequence numbers of chunks, by agent, in the order they came."""

    def __init__(self) -> None:
        self.chunks = self.lost = self.again = self.gaps = 0
        self._next: dict[int, int] = {}

    def take(self, agent: int, seq: int, gap: bool) -> None:
        """Note a chunk."""
        expected = self._next.get(agent, seq)
        self.chunks += 1
        self.gaps += gap
        self.lost += max(0, seq - expected)
        self.again += seq < expected
        self._next[agent] = max(expected, seq + 1)


class Relay:
    """Passes TCP on to a server; resets each connection `shortest` to `longest` seconds after the
    server first answered on it.
    """

    def __init__(self, host: str, port: int, seed: int, cuts: int) -> None:
        self._server = (host, port)
        self._random = random.Random(seed)
        self.left = cuts
        self.cut = 0

    async def open(self) -> int:
        """Starts listening; returns the port."""
        self._listener = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        return int(self._listener.sockets[0].getsockname()[1])

    async def _serve(self, near: asyncio.StreamReader, to_near: asyncio.StreamWriter) -> None:
        far, to_far = await asyncio.open_connection(*self._server)
        pipes = [asyncio.create_task(_pass(near, to_far)), asyncio.create_task(_pass(far, to_near))]
        timeout = self._random.uniform(0.3, 1.5) if self.left > 0 else None
        done, _ = await asyncio.wait(pipes, timeout=timeout, return_when=asyncio.FIRST_COMPLETED)
        if not done:
            self.left -= 1
            self.cut += 1
        for pipe in pipes:
            pipe.cancel()
        for writer in (to_near, to_far):
            raw = writer.get_extra_info("socket")
            if not done and raw is not None:  # a reset, with what is under way
                with suppress(OSError):
                    raw.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            writer.close()


async def _pass(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while data := await reader.read(1 << 16):
            writer.write(data)
            await writer.drain()


async def over_grpc(relay: Relay, session_id: str) -> dict[str, object]:
    """The Python client, until the relay has no cuts left and 2 s more have come."""
    counted = Counted()
    async with (
        wf.Client(f"127.0.0.1:{await relay.open()}") as client,
        await client.session(session_id) as session,
        session.stream() as stream,
    ):
        end = float("inf")
        async for batch in stream:
            for frames in batch:
                gap = wf.Flag.GAP in frames.flags
                counted.take(frames.agent.alias, frames.seq, gap)
            if relay.left <= 0:
                end = min(end, batch.sent_at + 2)
            if batch.sent_at > end:
                break
        resumes = stream.reconnections
    return {"client": "python, gRPC", "cuts": relay.cut, "resumes": resumes, **vars_of(counted)}


async def over_websocket(relay: Relay, session_id: str) -> dict[str, object]:
    """The web client in Node; it leaves when we close its input."""
    url = f"http://127.0.0.1:{await relay.open()}"
    pipe = asyncio.subprocess.PIPE
    node = await asyncio.create_subprocess_exec(
        *("node", "--experimental-websocket", str(READER), url, session_id), stdin=pipe, stdout=pipe
    )
    assert node.stdin and node.stdout
    while relay.left > 0 and node.returncode is None:
        await asyncio.sleep(0.1)
    await asyncio.sleep(4)
    node.stdin.close()
    said = json.loads(await node.stdout.read())
    counted = Counted()
    for agent, seq, gap in said["chunks"]:
        counted.take(agent, seq, gap)
    resumes = said["headers"] - 1
    return {"client": "web, WebSocket", "cuts": relay.cut, "resumes": resumes, **vars_of(counted)}


def vars_of(counted: Counted) -> dict[str, int]:
    """The figures of a reader."""
    return {key: value for key, value in vars(counted).items() if not key.startswith("_")}


def burn() -> None:
    """Keep a core busy."""
    while True:
        sum(range(10_000))


async def run(service: Service, given: argparse.Namespace) -> list[dict[str, object]]:
    """Both readers on one session."""
    web, grpc_host = urlsplit(service.url), service.grpc_address.rpartition(":")
    relays = [
        Relay(grpc_host[0], int(grpc_host[2]), given.seed, given.cuts),
        Relay(web.hostname or "", web.port or 0, given.seed + 1, given.cuts),
    ]
    async with (
        wf.Client(service.grpc_address) as client,
        await client.create_session() as session,
        asyncio.timeout(PATIENCE),
    ):
        specs = [wf.AgentSpec(position=(k % 8, 0.0, k // 8)) for k in range(given.agents)]
        for agent in await session.create_agents(*specs):
            await session.wander(agent, (0.0, 0.0, 0.0), 6.0)
        readers = [
            over_grpc(relays[0], session.session_id),
            over_websocket(relays[1], session.session_id),
        ]
        return list(await asyncio.gather(*readers))


def main() -> int:
    """Print a line per client; returns 1 when a chunk was lost or came twice."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cuts", type=int, default=100, help="connections to reset, per client")
    parser.add_argument("--agents", type=int, default=16)
    parser.add_argument("--busy", type=int, default=0, help="processes that burn CPU")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    busy = [multiprocessing.Process(target=burn, daemon=True) for _ in range(given.busy)]
    for process in busy:
        process.start()
    try:
        with Service() as service:
            found = asyncio.run(run(service, given))
    finally:
        for process in busy:
            process.terminate()
    sys.stdout.write("".join(json.dumps(row) + "\n" for row in found))
    return int(any(row["lost"] or row["again"] or row["gaps"] for row in found))


if __name__ == "__main__":
    sys.exit(main())
