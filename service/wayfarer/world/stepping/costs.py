"""Measured costs of engine calls and of the motion thread, in the warm-up and recently."""

from collections.abc import Sequence
from math import inf
from typing import Final

import numpy as np

from wayfarer.spec import STEP_SECONDS
from wayfarer.world.stepping.window import Window

WINDOW: Final = 10.0
"""Seconds over which running calls are averaged."""

ENOUGH: Final = 150
"""Number of calls, or turns, in a full window. With fewer, the missing ones count with the costs
below, since measurements while agents are created say little.
"""

FIRST_TURN, FIRST_CHUNK = 3e-4, 1e-4
"""Seconds of a turn and of a chunk until enough are measured. On an otherwise idle processor of 2.6
GHz a chunk takes 4e-5 (`python -m benchmarks.runtime_overhead`); these values assume that the
engine needs the same cores.
"""

FIRST_EXCESS: Final = 1.2
"""`Excess` until enough is measured: rather too high, so that agents are refused rather than late,
since admitted agents stay.
"""

OUTLIER: Final = 3.0
"""Longest call that is believed, as a multiple of the usual time of its size."""

Counts = Sequence[int]
"""Agents by gender (index into `spec.GENDERS`)."""

Weighted = Sequence[float]
"""Agents by gender, some of which count for less than one."""


class WarmCalls:
    """Durations of engine calls in the warm-up, with no other work."""

    def __init__(self, full: int) -> None:
        """`full`: rows to which batches are filled if there are enough agents."""
        self._full = full
        self._seconds: dict[int, dict[int, float]] = {}  # candidates → rows → seconds

    @property
    def known(self) -> bool:
        """Whether something has been measured."""
        return bool(self._seconds)

    def measured(self, rows: int, candidates: int, seconds: float) -> None:
        """Records that a call of this size took `seconds`; the shortest counts."""
        by_rows = self._seconds.setdefault(candidates, {})
        by_rows[rows] = min(seconds, by_rows.get(rows, inf))

    def call(self, rows: float, candidates: int) -> float:
        """Seconds of a call; interpolated between measured sizes, infinite if unknown."""
        by_rows = sorted(self._seconds.get(candidates, {}).items())
        if not by_rows or rows > by_rows[-1][0]:
            return inf
        known, seconds = zip(*by_rows, strict=True)
        return float(np.interp(rows, known, seconds))

    def count(self, agents: Weighted) -> float:
        """Number of calls for a step of all agents: full batches, at least one per gender."""
        return sum(max(count / self._full, 1.0) for count in agents if count)

    def share(self, agents: Weighted, candidates: int | None = None) -> float:
        """Share of the time that steps of all agents take; None: the fewest measured candidates.

        Infinite if this number of candidates, or batches as large, were not measured.
        """
        if candidates is None:
            candidates = min(self._seconds, default=0)
        seconds = 0.0
        for count in filter(None, agents):
            rows = min(count, self._full)
            seconds += self.call(rows, candidates) * count / rows
        return seconds / STEP_SECONDS


class Excess:
    """Ratio of measured to expected engine time over the recent window.

    It exceeds 1 when other programs use the processor, or when batches are not full because a new
    goal does not wait for others.
    """

    def __init__(self) -> None:
        self._seconds, self._expected = Window(WINDOW), Window(WINDOW)

    def add(self, now: float, seconds: float, expected: float, usual: float) -> None:
        """Records the `seconds` of a call. `expected`: those of its agents in full batches;
        `usual`: those of a call of its size.
        """
        self._seconds.add(now, min(seconds, OUTLIER * max(expected, usual)))
        self._expected.add(now, expected)

    def value(self, now: float) -> float:
        """The ratio, over all calls of the window."""
        seconds, expected = self._seconds.values(now), self._expected.values(now)
        if not sum(expected):
            return FIRST_EXCESS
        known = min(len(expected) / ENOUGH, 1.0)
        return known * sum(seconds) / sum(expected) + (1 - known) * FIRST_EXCESS


class Rest:
    """Time of the loop without stepping: a line fitted to its turns of the last seconds."""

    def __init__(self) -> None:
        self._seconds, self._chunks = Window(WINDOW), Window(WINDOW)

    def add(self, now: float, seconds: float, chunks: int) -> None:
        """Records a turn's `seconds`, without waiting and stepping, and its published `chunks`."""
        self._seconds.add(now, seconds)
        self._chunks.add(now, chunks)

    def line(self, now: float) -> tuple[float, float]:
        """Seconds for each turn, and for each chunk; neither is negative."""
        seconds, chunks = np.array(self._seconds.values(now)), np.array(self._chunks.values(now))
        if not len(seconds):
            return FIRST_TURN, FIRST_CHUNK
        spread = chunks - chunks.mean()
        slope = spread @ seconds / (spread @ spread) if spread.any() else 0.0
        per_chunk = float(np.clip(slope, 0.0, seconds.sum() / max(chunks.sum(), 1)))
        per_turn = max(float(seconds.mean() - per_chunk * chunks.mean()), 0.0)
        known = min(len(seconds) / ENOUGH, 1.0)
        return (
            known * per_turn + (1 - known) * FIRST_TURN,
            known * per_chunk + (1 - known) * FIRST_CHUNK,
        )

    def total(self, now: float) -> float:
        """Seconds of all turns of the window."""
        return sum(self._seconds.values(now))
