"""The worker's side of its pipes."""

import asyncio
import contextlib
import os
import sys
from collections.abc import AsyncIterator, Callable
from typing import Final

from pydantic import ValidationError

from wayfarer.errors import InvalidArgument, WayfarerError
from wayfarer.transport.gateway import Gateway
from wayfarer.workers.messages import Assignment, Report

REPORT_S: Final = 0.25
"""Between reports."""

STATS_S: Final = 1.0
"""How long a report waits for the figures of the motion loop before it does with the last ones."""


def read_assignment() -> Assignment:
    """What the supervisor has written. Raises InvalidArgument when it is no supervisor."""
    try:
        return Assignment.model_validate_json(sys.stdin.buffer.readline())
    except ValidationError:
        raise InvalidArgument(
            "a worker is started by `wayfarer serve --workers N`, not by hand"
        ) from None


def bind_to(cores: tuple[int, ...]) -> None:
    """Let this process run on these cores only, where the system can."""
    if cores and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, cores)


@contextlib.asynccontextmanager
async def supervised(gateway: Gateway, stop: Callable[[], None]) -> AsyncIterator[None]:
    """Report meanwhile; call `stop` once the supervisor is gone."""
    tasks = (
        asyncio.create_task(_report(gateway), name="reports"),
        asyncio.create_task(_until_orphaned(stop), name="supervisor"),
    )
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)


async def _report(gateway: Gateway) -> None:
    pipe = sys.stdout.fileno()
    os.set_blocking(pipe, False)
    agents = sessions = 0
    while True:
        with contextlib.suppress(WayfarerError, TimeoutError):
            async with asyncio.timeout(STATS_S):
                stats = await gateway.loop_stats()
            agents, sessions = stats.agents, stats.sessions
        report = Report(
            alive=gateway.alive,
            ready=gateway.ready,
            started=gateway.started,
            agents=agents,
            sessions=sessions,
        )
        # a supervisor that reads nothing, or is gone, is not worth waiting for
        with contextlib.suppress(BlockingIOError, BrokenPipeError):
            os.write(pipe, report.model_dump_json().encode() + b"\n")
        await asyncio.sleep(REPORT_S)


async def _until_orphaned(stop: Callable[[], None]) -> None:
    reader = asyncio.StreamReader()
    protocol = asyncio.StreamReaderProtocol(reader)
    await asyncio.get_running_loop().connect_read_pipe(lambda: protocol, sys.stdin.buffer)
    while await reader.read(4096):
        pass
    stop()
