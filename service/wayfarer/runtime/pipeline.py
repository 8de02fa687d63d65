"""Runs engine calls beside the motion thread.

At most two calls are in progress at a time, and they are taken out in order. While agents are due,
the next call is submitted before one is complete, so the engine's threads do not wait for Python.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

from wayfarer.engines.engine import StepOutputs
from wayfarer.world.stepping.engine_call import Launch, Outputs, PendingStep

DEPTH: Final = 2
"""Maximum engine calls in progress at a time."""


@dataclass(slots=True)
class _Call:
    """A step in progress; its times are the clock's."""

    step: PendingStep
    started_at: float
    ended_at: float | None = None


class EnginePipeline:
    """Belongs to the motion thread, except for its own threads."""

    def __init__(self, clock: Callable[[], float], wake: Callable[[], None]) -> None:
        """`wake` is called, from another thread, whenever a call is complete."""
        self._clock = clock
        self._wake = wake
        self._pool = ThreadPoolExecutor(DEPTH, "engine-call")
        self._calls: tuple[_Call, ...] = ()  # replaced as a whole: `age` reads it from any thread
        self._last_ended = float("-inf")

    def age(self, now: float) -> float:
        """Seconds since the first unfinished call was started; 0 without one. Thread-safe.

        A finished call does not count: it may wait long while the thread may not step.
        """
        return max((now - c.started_at for c in self._calls if c.ended_at is None), default=0.0)

    @property
    def is_idle(self) -> bool:
        """Whether no call is in progress, or waits to be taken out."""
        return not self._calls

    @property
    def has_room(self) -> bool:
        """Whether another call can be submitted."""
        return len(self._calls) < DEPTH

    @property
    def has_completed(self) -> bool:
        """Whether the first call is complete."""
        return bool(self._calls) and self._calls[0].ended_at is not None

    def submit(self, schedule: Callable[[Launch], PendingStep | None]) -> bool:
        """Starts a call; returns False if `schedule` finds nothing to do."""
        futures: list[Future[StepOutputs]] = []

        def launch(call: Outputs) -> Outputs:
            futures.append(self._pool.submit(call))
            return futures[0].result

        started_at = self._clock()
        step = schedule(launch)
        if step is None:
            return False
        call = _Call(step, started_at)
        self._calls += (call,)
        futures[0].add_done_callback(lambda _: self._end(call))
        return True

    def completed(self) -> Iterator[tuple[PendingStep, float]]:
        """Takes out complete steps in order, each with the seconds that the engine spent on it."""
        while self.has_completed:
            call, *rest = self._calls
            self._calls = tuple(rest)
            assert call.ended_at is not None
            seconds = max(call.ended_at - max(call.started_at, self._last_ended), 0.0)
            self._last_ended = call.ended_at
            yield call.step, seconds

    def close(self) -> None:
        """Submits nothing more; calls in progress are lost."""
        self._pool.shutdown(wait=False)

    def _end(self, call: _Call) -> None:
        call.ended_at = self._clock()
        self._wake()
