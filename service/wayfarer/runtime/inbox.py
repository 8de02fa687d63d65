"""Commands from event loops to the motion thread, and their results."""

import asyncio
import contextlib
import queue
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from threading import Lock
from typing import Any, TypeVar

from wayfarer.errors import Unavailable, WayfarerError

T = TypeVar("T")

MAX_BATCH = 256
"""Maximum commands served in a row, so that many of them cannot delay the motion."""


def post(loop: asyncio.AbstractEventLoop, call: Callable[..., Any], *args: Any) -> None:
    """Makes `loop` call soon; does nothing if the loop is closed and so has no waiters."""
    with contextlib.suppress(RuntimeError):
        loop.call_soon_threadsafe(call, *args)


@dataclass(frozen=True, slots=True)
class Command:
    """A call for the motion thread, and the future that receives its result."""

    call: Callable[[], Any]
    loop: asyncio.AbstractEventLoop
    future: asyncio.Future[Any]

    def run(self) -> None:
        """Makes the call; its result or its error goes to the future."""
        try:
            result = self.call()
        except Exception as error:  # any error belongs to the caller
            self.fail(error)
        else:
            post(self.loop, self._settle, self.future.set_result, result)

    def fail(self, error: Exception) -> None:
        """Ends the future with `error`."""
        post(self.loop, self._settle, self.future.set_exception, error)

    def _settle(self, settle: Callable[[Any], None], outcome: Any) -> None:
        if not self.future.done():  # the caller may have been cancelled meanwhile
            settle(outcome)


class Inbox:
    """Bounded queue; closed until the motion thread opens it, and when that thread ends."""

    def __init__(self, size: int) -> None:
        self._queue = queue.SimpleQueue[Command | None]()  # in C: a third of `Queue`'s time
        self._size = size
        self._gate = Lock()  # so that nothing enters after the last drain
        self._refusal: Callable[[], WayfarerError] | None = partial(
            Unavailable, "the motion loop has not been started"
        )

    async def ask(self, call: Callable[[], T]) -> T:
        """Runs `call` on the motion thread. Raises Unavailable, or what `call` raises."""
        loop = asyncio.get_running_loop()
        command = Command(call, loop, loop.create_future())
        with self._gate:
            if self._refusal is not None:
                raise self._refusal()
            if self._queue.qsize() >= self._size:
                raise Unavailable(f"{self._size} commands are waiting already; try again")
            self._queue.put(command)
        result: T = await command.future
        return result

    def open(self) -> None:
        """Accepts commands from now on."""
        with self._gate:
            self._refusal = None

    def close(self, reason: str, error: type[WayfarerError] = Unavailable) -> None:
        """Refuses later and waiting commands with `error(reason)`."""
        with self._gate:
            self._refusal = partial(error, reason)
            waiting = self._drain()
        for command in waiting:
            command.fail(error(reason))

    def wake(self) -> None:
        """Ends a `serve` that waits."""
        with self._gate:
            if self._queue.empty():
                self._queue.put(None)

    def serve(self, timeout: float) -> None:
        """Runs waiting commands; if there are none, waits up to `timeout` seconds for one."""
        try:
            first = self._queue.get(timeout=timeout) if timeout > 0 else self._queue.get_nowait()
        except queue.Empty:
            return
        for command in [first, *self._drain(MAX_BATCH)]:
            if command is not None:
                command.run()

    def _drain(self, most: int = 2**31) -> list[Command]:
        commands: list[Command] = []
        while len(commands) < most:
            try:
                command = self._queue.get_nowait()
            except queue.Empty:
                break
            if command is not None:
                commands.append(command)
        return commands
