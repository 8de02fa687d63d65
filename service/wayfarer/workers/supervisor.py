"""All workers together: started at once, watched, stopped at once."""

import asyncio
import signal
from collections.abc import Sequence
from typing import Final

import structlog

from wayfarer.workers.process import WorkerProcess

log = structlog.get_logger(__name__)

LOOK_S: Final = 0.05
"""Seconds between checks whether all are ready."""


class Supervisor:
    """Owns the processes."""

    def __init__(self, workers: Sequence[WorkerProcess]) -> None:
        self.workers = workers
        self._tasks: list[asyncio.Task[None]] = []

    @property
    def ready(self) -> bool:
        """All workers are."""
        return all(worker.report.ready for worker in self.workers)

    @property
    def started(self) -> bool:
        """All workers that run have been ready once."""
        return all(worker.report.started for worker in self.workers)

    async def start(self) -> None:
        """Start all; return when they are ready. Raises Unavailable when one will not be."""
        self._tasks = [
            asyncio.create_task(worker.keep(), name=f"worker {worker.index}")
            for worker in self.workers
        ]
        while not self.ready:
            await asyncio.wait(self._tasks, timeout=LOOK_S, return_when=asyncio.FIRST_COMPLETED)
            if any(task.done() for task in self._tasks):
                return self._fail()

    async def until_one_ends(self) -> None:
        """Return when a worker has ended by itself: an admin has drained it."""
        await asyncio.wait(self._tasks, return_when=asyncio.FIRST_COMPLETED)
        self._fail()

    def reload(self) -> None:
        """Let all read their keys again."""
        for worker in self.workers:
            if worker.report.started:  # before, it would end by it
                worker.signal(signal.SIGHUP)

    async def stop(self, seconds: float) -> None:
        """Let all drain; kill those that have not ended after `seconds`. Safe to call twice."""
        for worker in self.workers:
            worker.stop()
        if not self._tasks:
            return
        _, late = await asyncio.wait(self._tasks, timeout=seconds)
        for task in late:
            log.error("worker killed, since it did not end", name=task.get_name())
            task.cancel()
        await asyncio.wait(self._tasks)

    def _fail(self) -> None:
        for task in self._tasks:
            if task.done() and not task.cancelled() and (error := task.exception()):
                raise error
