"""One worker as its supervisor sees it: a process that is started, watched, and started again."""

import asyncio
import contextlib
import signal
import time
from asyncio.subprocess import PIPE, Process
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import structlog
from pydantic import ValidationError

from wayfarer.errors import Unavailable
from wayfarer.workers.messages import DOWN, Report

log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True)
class Patience:
    """Seconds."""

    start: float = 120.0  # until the first report
    silence: float = 10.0  # without a report, or with a motion loop that hangs, and it is killed
    first_pause: float = 0.25  # before it is started again; twice as long each time
    longest_pause: float = 30.0
    calm: float = 60.0  # seconds of life after which the pauses start again at the shortest


PATIENCE: Final = Patience()


class WorkerProcess:
    """Runs `command`, which reads the assignment and reports (messages.py)."""

    def __init__(
        self,
        index: int,
        command: Sequence[str],
        assignment: bytes,
        patience: Patience = PATIENCE,
    ) -> None:
        """`assignment`: one line."""
        self.index = index
        self.report: Report = DOWN
        self.restarts = 0
        self._command = command
        self._assignment = assignment
        self._patience = patience
        self._process: Process | None = None
        self._stopping = asyncio.Event()
        self._was_ready = False

    @property
    def pid(self) -> int | None:
        """Id of the process; None while there is none."""
        return self._process.pid if self._process else None

    async def keep(self) -> None:
        """Have it run until it ends of its own will: asked to stop, or drained by an admin.

        Raises Unavailable when it ends otherwise before it has ever been ready.
        """
        pause = self._patience.first_pause
        while not self._stopping.is_set():
            began = time.monotonic()
            code = await self._once()
            if code == 0 or self._stopping.is_set():
                return
            if not self._was_ready:
                raise Unavailable(
                    f"worker {self.index} ended with {code} while starting; see above"
                )
            if time.monotonic() - began > self._patience.calm:
                pause = self._patience.first_pause
            log.error("worker ended", worker=self.index, code=code, again_in_s=pause)
            self.restarts += 1
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stopping.wait(), pause)
            pause = min(2 * pause, self._patience.longest_pause)

    def signal(self, number: signal.Signals) -> None:
        """Send a signal, if it runs."""
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                self._process.send_signal(number)

    def stop(self) -> None:
        """Let it drain and end, and start it no more."""
        self._stopping.set()
        self.signal(signal.SIGTERM)

    async def _once(self) -> int:
        """One life; the exit code."""
        # in a session of its own: a terminal's Ctrl-C is for the supervisor to pass on
        process = await asyncio.create_subprocess_exec(
            *self._command, stdin=PIPE, stdout=PIPE, start_new_session=True
        )
        self._process = process
        assert process.stdin is not None
        try:
            with contextlib.suppress(ConnectionError):
                process.stdin.write(self._assignment + b"\n")
                await process.stdin.drain()
            if self._stopping.is_set():
                self.signal(signal.SIGTERM)
            await self._listen(process)
            return await process.wait()
        finally:
            self.report, self._process = DOWN, None
            if process.returncode is None:
                with contextlib.suppress(ProcessLookupError):
                    process.kill()
                await process.wait()

    async def _listen(self, process: Process) -> None:
        """Take reports until there are no more, or too few."""
        assert process.stdout is not None
        limit, well_at = self._patience.start, time.monotonic()
        while True:
            try:
                async with asyncio.timeout(limit):
                    line = await process.stdout.readline()
            except TimeoutError:
                break
            if not line:
                return
            self._take(line)
            limit = self._patience.silence
            if self.report.alive or not self.report.started:
                well_at = time.monotonic()
            elif time.monotonic() - well_at > self._patience.silence:
                break
        if not self._stopping.is_set():
            log.error("worker hangs", worker=self.index, for_s=limit)
            process.kill()

    def _take(self, line: bytes) -> None:
        try:
            self.report = Report.model_validate_json(line)
        except ValidationError:
            log.warning("worker wrote what is no report", worker=self.index)
            return
        self._was_ready |= self.report.ready
