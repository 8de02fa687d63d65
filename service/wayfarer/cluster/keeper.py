"""A node's keeper: starts its process, watches it, starts it again, and carries what it says to the
directory.

The node writes a `NodeCall` per line and reads a `NodeReply` per line. So it needs no Ray, and what
it holds is never in the memory of one who speaks to Ray.
"""

import asyncio
import contextlib
import secrets
import signal
import sys
import time
from asyncio.subprocess import PIPE, Process
from collections.abc import Sequence
from typing import Final

import structlog
from pydantic import ValidationError

from wayfarer.cluster.directory_service import DirectoryClient, DirectoryLink
from wayfarer.cluster.messages import NodeCall, NodePlan, NodeReply
from wayfarer.errors import WayfarerError

log = structlog.get_logger(__name__)

COMMAND: Final = (sys.executable, "-m", "wayfarer", "node")

LINE_BYTES: Final = 16 * 1024 * 1024
START_S: Final = 120.0
"""Seconds until a node must have said something."""

SILENCE_S: Final = 10.0
"""Seconds without a word after which a node hangs, and is killed."""

PAUSES_S: Final = (0.25, 30.0)
"""First and longest pause before a start; twice as long each time."""

CALM_S: Final = 60.0
"""A life of this length brings the pauses back to the shortest."""


class NodeKeeper:
    """Of one node at a time: each life has a name of its own."""

    def __init__(
        self, plan: NodePlan, link: DirectoryLink, command: Sequence[str] = COMMAND
    ) -> None:
        """`plan.name` begins the names."""
        self._plan = plan
        self._link = link
        self._directory = DirectoryClient(link)
        self._command = command
        self._process: Process | None = None
        self._spoke = False  # the process has
        self._stopping = asyncio.Event()
        self.name = plan.name
        self.restarts = 0

    @property
    def pid(self) -> int | None:
        """Id of the process; None while there is none."""
        return self._process.pid if self._process else None

    async def keep(self) -> None:
        """Have a node run until it ends of its own will, as after a drain, or `stop` is called."""
        pause = PAUSES_S[0]
        while not self._stopping.is_set():
            began = time.monotonic()
            code = await self._once()
            if code == 0 or self._stopping.is_set():
                return
            if time.monotonic() - began > CALM_S:
                pause = PAUSES_S[0]
            how = f"exit code {code}" if code > 0 else f"signal {-code}, {signal.strsignal(-code)}"
            log.error("node ended", node=self.name, by=how, again_in_s=pause)
            self.restarts += 1
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stopping.wait(), pause)
            pause = min(2 * pause, PAUSES_S[1])

    def stop(self) -> None:
        """Let the node end, and start none again."""
        self._stopping.set()
        self._signal(signal.SIGTERM)

    def reload(self) -> None:
        """Let the node read its keys again."""
        if self._spoke:  # before, it would end by it
            self._signal(signal.SIGHUP)

    def _signal(self, number: signal.Signals) -> None:
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                self._process.send_signal(number)

    async def _once(self) -> int:
        """One life; its exit code."""
        self.name = f"{self._plan.name}-{secrets.token_hex(3)}"
        plan = self._plan.model_copy(update={"name": self.name})
        process = await asyncio.create_subprocess_exec(
            *self._command, stdin=PIPE, stdout=PIPE, start_new_session=True, limit=LINE_BYTES
        )
        self._process = process
        try:
            with contextlib.suppress(ConnectionError):
                await _write(process, plan.model_dump_json())
                if self._stopping.is_set():  # before there was a process to tell
                    self._signal(signal.SIGTERM)
                await self._relay(process)
            return await process.wait()
        finally:
            self._process, self._spoke = None, False
            if process.returncode is None:
                with contextlib.suppress(ProcessLookupError):
                    process.kill()
                await process.wait()
            # while all end, nobody shall adopt anything
            if not self._stopping.is_set():
                with contextlib.suppress(WayfarerError):  # else its lease tells
                    await self._directory.ended(self.name)

    async def _relay(self, process: Process) -> None:
        """Carry calls and answers until the node ends, or is silent for too long."""
        assert process.stdout is not None
        patience = START_S
        while True:
            try:
                async with asyncio.timeout(patience):
                    line = await process.stdout.readline()
            except TimeoutError:
                log.error("node hangs", node=self.name, for_s=patience)
                process.kill()
                return
            if not line:
                return
            patience, self._spoke = SILENCE_S, True
            try:
                call = NodeCall.model_validate_json(line)
            except ValidationError:
                log.warning("node wrote what is no call", node=self.name)
                continue
            await _write(process, (await self._reply(call)).model_dump_json())

    async def _reply(self, call: NodeCall) -> NodeReply:
        try:
            return NodeReply(number=call.number, body=await self._link.call(call.method, call.body))
        except WayfarerError as error:
            return NodeReply(number=call.number, problem=str(error))


async def _write(process: Process, line: str) -> None:
    assert process.stdin is not None
    process.stdin.write(line.encode() + b"\n")
    await process.stdin.drain()
