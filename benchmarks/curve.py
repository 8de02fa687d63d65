"""The largest batch that keeps real time, found by doubling and bisection."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf
from typing import Final

from wayfarer.spec import STEP_SECONDS

LEAST: Final = 64
MOST: Final = 1 << 20
FINE: Final = 1 / 16
"""The bisection ends when the gap between in time and too late is below this share."""


@dataclass(frozen=True)
class Point:
    """A batch that was timed."""

    agents: int
    seconds: float  # infinite when it ran out of memory
    memory: int = 0  # bytes

    @property
    def in_time(self) -> bool:
        """Whether a step ends before the next one is due."""
        return self.seconds <= STEP_SECONDS


def curve(timed: Callable[[int], Point], until: float) -> Iterator[Point]:
    """Yields doubled batches while they are in time, then those of the bisection.

    No batch is begun after `until`, an instant of `time.monotonic`.
    """
    known, late = 0, 0
    agents = LEAST
    while agents <= MOST and time.monotonic() < until:
        point = timed(agents)
        yield point
        if point.in_time:
            known = agents
        else:
            late = agents
        if not late:
            agents *= 2
        elif late - known > max(FINE * late, 1):
            agents = (known + late) // 2
        else:
            return


def ended_by(points: list[Point]) -> str:
    """The limit that a larger batch would exceed."""
    late = min((p for p in points if not p.in_time), key=lambda p: p.agents, default=None)
    if late is None:
        return "largest batch" if points and points[-1].agents == MOST else "time of the benchmark"
    return "memory" if late.seconds == inf else f"{STEP_SECONDS} s"
