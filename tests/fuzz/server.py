"""`wayfarer serve` as a separate process, whose log is kept."""

import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil

from wayfarer_lab.load.target import Target

COMMAND = (sys.executable, "-m", "wayfarer", "serve", "--log-format", "json")
ANY_PORTS = ("--http-port", "0", "--grpc-port", "0")
START_SECONDS = 240.0
WRONG = ("error", "critical")


@dataclass(frozen=True)
class Served:
    """A running server."""

    target: Target
    process: asyncio.subprocess.Process
    log: Path

    @property
    def errors(self) -> list[str]:
        """Logged events that should not have happened."""
        lines = entries(self.log)
        return [json.dumps(line)[:2000] for line in lines if line.get("level") in WRONG]

    @property
    def threads(self) -> int:
        """Number of the process's threads."""
        return psutil.Process(self.process.pid).num_threads()


@asynccontextmanager
async def served(
    log: Path, arguments: tuple[str, ...] = (), settings: Mapping[str, str] | None = None
) -> AsyncIterator[Served]:
    """Runs a server on free ports of the loopback; it must run until it is ended here."""
    clean = {k: v for k, v in os.environ.items() if not k.startswith("WAYFARER_")}
    with log.open("w") as file:
        process = await asyncio.create_subprocess_exec(
            *(*COMMAND, *ANY_PORTS, *arguments),
            env={**clean, **(settings or {})},
            stdout=asyncio.subprocess.DEVNULL,
            stderr=file,
        )
    try:
        async with asyncio.timeout(START_SECONDS):
            ready = await _announcement(process, log)
        target = Target(ready["grpc"], ready["http"], (), psutil.Process(process.pid))
        yield Served(target, process, log)
        assert process.returncode is None, f"the server has ended:\n{log.read_text()[-3000:]}"
    finally:
        if process.returncode is None:
            process.send_signal(signal.SIGTERM)
            try:
                async with asyncio.timeout(15):
                    await process.wait()
            except TimeoutError:
                process.kill()
                await process.wait()


def entries(log: Path) -> list[dict]:
    """The lines of a log, as far as they are whole."""
    found = []
    for line in log.read_text().splitlines():
        try:
            found.append(json.loads(line))
        except ValueError:  # being written, or not a line of the log
            continue
    return [entry for entry in found if isinstance(entry, dict)]


async def _announcement(process: asyncio.subprocess.Process, log: Path) -> dict:
    while True:
        for entry in entries(log):
            if entry.get("event") == "ready":
                return entry
        assert process.returncode is None, f"the server did not start:\n{log.read_text()}"
        await asyncio.sleep(0.05)
