"""The server under load: one that runs already, or one of our own."""

import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass

import psutil

from wayfarer.errors import Unavailable

START_SECONDS = 60.0


@dataclass(frozen=True)
class Target:
    """Where a server is, and how to get in."""

    grpc: str  # host:port
    http: str  # http://host:port
    metadata: tuple[tuple[str, str], ...] = ()
    process: psutil.Process | None = None  # when it runs on this machine as our own

    def cpu_seconds(self) -> float | None:
        """CPU time of the server so far; None when it is not ours."""
        if self.process is None:
            return None
        times = self.process.cpu_times()
        return float(times.user + times.system)

    def resident_megabytes(self) -> float | None:
        """Memory of the server; None when it is not ours."""
        return None if self.process is None else self.process.memory_info().rss / 1e6


@asynccontextmanager
async def own_server(
    arguments: tuple[str, ...], settings: Mapping[str, str]
) -> AsyncIterator[Target]:
    """A `wayfarer serve` on free ports of the loopback, ended afterwards.

    `arguments` are options of the command, `settings` environment variables.
    Raises Unavailable when it does not come up.
    """
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "wayfarer.cli", "serve", "--http-port", "0", "--grpc-port", "0"),
        *("--log-format", "json", *arguments),
        env={**os.environ, **settings},
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    assert process.stdout is not None
    lines: list[str] = []
    try:
        try:
            async with asyncio.timeout(START_SECONDS):
                ready = await _announcement(process.stdout, lines)
        except (TimeoutError, EOFError) as error:
            raise Unavailable("the server did not start:\n" + "".join(lines[-20:])) from error
        draining = asyncio.create_task(_drain(process.stdout))
        yield Target(ready["grpc"], ready["http"], (), psutil.Process(process.pid))
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


async def _announcement(output: asyncio.StreamReader, lines: list[str]) -> dict[str, str]:
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


async def _drain(output: asyncio.StreamReader) -> None:
    """Keep the pipe from filling up."""
    while await output.read(1 << 16):
        pass
