"""Motion off the real-time path: clips and replays, in separate threads.

A job is a generator that runs in a thread as its items are requested, one ahead of the reader, so
that nothing accumulates for a slow reader. The job ends when its reader leaves, or takes nothing
for too long.

The threads have normal priority. A low-priority thread preempted while holding the GIL would block
every other thread of the process (priority inversion).
"""

import asyncio
import threading
from collections.abc import AsyncGenerator, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Final, Generic, TypeVar

from wayfarer.errors import ResourceExhausted

T = TypeVar("T")

PATIENCE: Final = 30.0
"""Seconds that a job waits for its reader."""

RETRY_AFTER: Final = 2.0
"""Seconds until a refused caller may try again."""

_END: Final = object()


class Offline:
    """Runs up to `jobs` jobs at a time."""

    def __init__(self, jobs: int, patience: float = PATIENCE) -> None:
        self._jobs = jobs
        self._patience = patience
        self._running = 0
        self._lock = threading.Lock()

    @property
    def running(self) -> int:
        """Number of places that are taken."""
        return self._running

    @contextmanager
    def place(self) -> Iterator[None]:
        """Takes one of the places for a while, from any thread. Raises ResourceExhausted."""
        self._take()
        try:
            yield
        finally:
            self._give_back()

    async def run(self, make: Callable[[], Iterator[T]]) -> AsyncGenerator[T]:
        """Yields what `make()` yields; both it and the iterator run in the job's thread.

        Raises ResourceExhausted if all places are taken, or if the reader has taken nothing for too
        long; and what the job raises. Close it with `aclose` to end the job early.
        """
        self._take()
        job = _Job(make, self._give_back)
        loop = asyncio.get_running_loop()
        try:
            while (item := await job.next()) is not _END:
                job.prefetch()
                timer = loop.call_later(self._patience, job.end)
                try:
                    yield item  # type: ignore[misc]  # not _END
                finally:
                    timer.cancel()
                if job.ended:
                    raise ResourceExhausted(
                        f"nothing was read for {self._patience:g} s; ask again, and read faster"
                    )
        finally:
            job.end()

    def _take(self) -> None:
        with self._lock:
            if self._running >= self._jobs:
                raise ResourceExhausted(
                    f"{self._jobs} clips, replays and lock-step calls are being made, as many as "
                    "limits.offline_jobs allows at a time; try again later",
                    RETRY_AFTER,
                )
            self._running += 1

    def _give_back(self) -> None:
        with self._lock:
            self._running -= 1


class _Job(Generic[T]):
    """A generator in a separate thread."""

    def __init__(self, make: Callable[[], Iterator[T]], ended: Callable[[], None]) -> None:
        """`ended` is called on the job's thread when it has finished."""
        self._make = make
        self._ended = ended
        self._items: Iterator[T] | None = None
        self._executor = ThreadPoolExecutor(1, "offline")
        self._ahead: asyncio.Future[T | object] | None = None
        self._closed = False
        self.ended = False

    async def next(self) -> T | object:
        """The next item, or `_END`."""
        self.prefetch()
        assert self._ahead is not None
        ahead, self._ahead = self._ahead, None
        return await ahead

    def prefetch(self) -> None:
        """Begins with the next item, unless that has begun; there must be one."""
        if self._ahead is None:
            loop = asyncio.get_running_loop()
            self._ahead = loop.run_in_executor(self._executor, self._next)

    def end(self) -> None:
        """Does nothing after the present item. Safe to call twice."""
        if self.ended:
            return
        self.ended = True
        if self._ahead is not None:
            self._ahead.add_done_callback(_forget)
        self._executor.submit(self._close)
        self._executor.shutdown(wait=False)

    def _next(self) -> T | object:
        """Runs on the thread. Frees its place before the reader gets the end or an error."""
        item: T | object = _END
        try:
            if self._items is None:
                self._items = self._make()
            item = next(self._items, _END)
        finally:
            if item is _END:
                self._close()
        return item

    def _close(self) -> None:
        """Runs on the thread."""
        if not self._closed:
            self._closed = True
            self._items = None  # ends the generator
            self._ended()


def _forget(ahead: "asyncio.Future[object]") -> None:
    if not ahead.cancelled():
        ahead.exception()  # nobody will read it
