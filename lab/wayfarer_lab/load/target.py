"""The server under load: a running one, or our own."""

import asyncio
import json
import os
import signal
import sys
from collections import deque
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass

import psutil

from wayfarer.errors import Unavailable
from wayfarer_lab.load.plan import LoadPlan

SERVE = ("-m", "wayfarer", "serve")

START_SECONDS = 180.0

LINE_BYTES = 1 << 20
LINES_SHOWN = 20
"""Number of last log lines of a failed server that are shown."""


@dataclass(frozen=True)
class Target:
    """Addresses and credentials of a server."""

    grpc: str  # host:port
    http: str  # http://host:port
    metadata: tuple[tuple[str, str], ...] = ()
    process: psutil.Process | None = None  # if it is our own, on this machine

    def cpu_seconds(self) -> float | None:
        """CPU time of the server so far, its workers' included; None when it is not ours."""
        if self.process is None:
            return None
        times = [process.cpu_times() for process in self._processes()]
        return float(sum(each.user + each.system for each in times))

    def resident_megabytes(self) -> float | None:
        """Memory of the server, its workers' included; None when it is not ours."""
        if self.process is None:
            return None
        return sum(process.memory_info().rss for process in self._processes()) / 1e6

    def _processes(self) -> list[psutil.Process]:
        assert self.process is not None
        return [self.process, *self.process.children(recursive=True)]


@asynccontextmanager
async def own_server(
    arguments: tuple[str, ...],
    settings: Mapping[str, str],
    command: tuple[str, ...] = SERVE,
) -> AsyncIterator[Target]:
    """A `wayfarer serve` on free ports of the loopback, ended afterwards.

    `arguments` are options of the command, `settings` environment variables. Another `command` of
    this Python has to take the same options.
    Raises Unavailable when it does not come up.
    """
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, *command, "--http-port", "0", "--grpc-port", "0"),
        *("--log-format", "json", *arguments),
        env={**os.environ, **settings},
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        limit=LINE_BYTES,
    )
    assert process.stdout is not None
    lines: deque[str] = deque(maxlen=LINES_SHOWN)
    try:
        try:
            async with asyncio.timeout(START_SECONDS):
                ready = await _announcement(process.stdout, lines)
        except (TimeoutError, EOFError) as error:
            raise Unavailable("the server did not start:\n" + "".join(lines)) from error
        draining = asyncio.create_task(_drain(process.stdout, lines))
        yield Target(ready["grpc"], ready["http"], (), psutil.Process(process.pid))
        if draining.done():
            raise Unavailable("the server ended under load:\n" + "".join(lines))
        draining.cancel()
    finally:
        if process.returncode is None:
            process.send_signal(signal.SIGTERM)
            try:
                async with asyncio.timeout(10):
                    await process.wait()
            except TimeoutError:
                process.kill()
                await process.wait()


async def _announcement(output: asyncio.StreamReader, lines: deque[str]) -> dict[str, str]:
    """The line that says where the server listens."""
    while line := await output.readline():
        lines.append(line.decode(errors="replace"))
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        if isinstance(entry, dict) and entry.get("event") == "ready":
            return {"grpc": entry["grpc"], "http": entry["http"]}
    raise EOFError


async def _drain(output: asyncio.StreamReader, lines: deque[str]) -> None:
    """Keeps the pipe from filling up."""
    while line := await output.readline():
        lines.append(line.decode(errors="replace"))


def room(agents: int, plan: LoadPlan) -> dict[str, str]:
    """Limits of our own server that are out of the way, so that only its speed counts."""
    streams = plan.sessions + plan.slow + plan.vanishing + 8
    limits = {
        "AGENTS": agents,
        "AGENTS_PER_SESSION": agents,
        "AGENTS_PER_CALL": 64,
        "SESSIONS": plan.sessions + 8,
        "SESSIONS_PER_CALLER": plan.sessions + 8,
        "STREAMS": streams,
        "STREAMS_PER_SESSION": streams,
        "CALLS_PER_SECOND": 100_000,
    }
    return {f"WAYFARER_LIMITS__{name}": str(value) for name, value in limits.items()}
