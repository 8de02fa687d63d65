"""The composition root of a server with several workers: supervisor and front in one process."""

import asyncio
import contextlib
import signal
import sys
from collections.abc import Callable, Coroutine
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import structlog

from wayfarer.config import Settings
from wayfarer.transport.server_options import ServerOptions
from wayfarer.transport.worker_sockets import WorkerSockets
from wayfarer.workers.assignments import assignments
from wayfarer.workers.front import Front
from wayfarer.workers.placement import Placement
from wayfarer.workers.process import WorkerProcess
from wayfarer.workers.supervisor import Supervisor

log = structlog.get_logger(__name__)

COMMAND: Final = (sys.executable, "-m", "wayfarer.cli", "worker")

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)

GRACE_S: Final = 5.0
"""Beyond what a worker takes at most to drain."""


async def serve_workers(settings: Settings, announce: Callable[[str, str], None]) -> None:
    """Run until SIGINT, SIGTERM or AdminService.Drain.

    `announce` gets the HTTP URL and the gRPC address once all workers are ready.
    """
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for sign in SIGNALS:
        loop.add_signal_handler(sign, stop.set)
    # the workers trace; files of keys and certificates are checked before any is started
    operation = ServerOptions.from_settings(settings.model_copy(update={"otlp_endpoint": ""}))
    with TemporaryDirectory(prefix="wayfarer-") as folder:  # its user's alone
        plan = assignments(settings, Path(folder))
        supervisor = Supervisor(
            [WorkerProcess(a.index, COMMAND, a.model_dump_json().encode()) for a in plan]
        )

        def reload() -> None:
            operation.guard.authenticator.reload()
            supervisor.reload()

        loop.add_signal_handler(signal.SIGHUP, reload)
        doors = [WorkerSockets(a.folder) for a in plan]
        front = Front(settings, operation, doors, Placement(supervisor.workers), supervisor)
        await front.start()
        try:
            if await _either(supervisor.start(), stop):
                announce(front.http_url, front.grpc_address)
                await _either(supervisor.until_one_ends(), stop)
            for sign in SIGNALS:
                loop.remove_signal_handler(sign)  # one more ends the process at once
            log.info("draining", workers=len(plan))
            await front.drain()
        finally:
            await supervisor.stop(2 * settings.drain_s + GRACE_S)
            await front.stop()
    log.info("stopped")


async def _either(work: Coroutine[Any, Any, None], stop: asyncio.Event) -> bool:
    """Whether the work was done before the stop. Raises what it raises."""
    tasks: list[asyncio.Task[Any]] = [
        asyncio.create_task(work),
        asyncio.create_task(stop.wait()),
    ]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        if tasks[0].done():
            tasks[0].result()
            return True
        return False
    finally:
        for task in tasks:
            task.cancel()
        with contextlib.suppress(Exception):
            await asyncio.wait(tasks)
