"""How many agents fit: from what engine calls take, and the rest of the loop, as measured.

Agents are admitted as long as the motion thread, on the last rung of the ladder that still steps
everybody (one candidate), would be busy for no more than a share of the time. Its work in 0.2 s is
an engine call for each batch that the scheduler makes, and what it does beside: a little for each
such turn, a little for each chunk.

    busy = Σ over phases and genders of calls' seconds / 0.2 s + turns · a + chunks · b
"""

from bisect import bisect_right
from collections.abc import Sequence
from math import inf, isfinite
from statistics import median
from threading import Lock
from typing import NamedTuple

import numpy as np

from wayfarer.errors import ResourceExhausted
from wayfarer.runtime.settings import WorldSettings
from wayfarer.runtime.stats import Window
from wayfarer.runtime.stepping.phases import Phases, spread
from wayfarer.runtime.stepping.scheduler import Call
from wayfarer.spec import STEP_SECONDS

WINDOW = 10.0
"""Seconds over which running calls are averaged."""

REFRESH = 1.0
"""Seconds until the number of agents that fit is counted anew."""

ENOUGH = 50
"""Calls, or turns, of the window; as long as there are fewer, those that are missing count as if
they took what they do in the warm-up. What is measured while agents are created tells little."""


FIRST_TURN, FIRST_CHUNK = 3e-4, 4e-5
"""Seconds of a turn and of a chunk until there are enough measured: what they take on a server's
processor of 2.6 GHz, by `python -m benchmarks.runtime_overhead`."""


class Prices(NamedTuple):
    """What things take at present."""

    slowness: float  # engine calls: so many times what they took in the warm-up
    turn: float  # seconds of a turn, wait and step aside …
    chunk: float  # … and for each chunk that it publishes


class Costs:
    """What calls of the engine take: as in the warm-up, times how much slower they run now."""

    def __init__(self) -> None:
        self._warm: dict[int, dict[int, float]] = {}  # candidates → rows → seconds
        self._slowness = Window(WINDOW)

    @property
    def known(self) -> bool:
        """Something has been measured."""
        return bool(self._warm)

    def measured(self, call: Call, seconds: float) -> None:
        """A call of this kind took so long in the warm-up; the shortest counts."""
        by_rows = self._warm.setdefault(call.candidates, {})
        by_rows[call.rows] = min(seconds, by_rows.get(call.rows, inf))

    def spent(self, now: float, call: Call, seconds: float) -> None:
        """A call of this kind took so long just now."""
        if isfinite(expected := self._expected(call)):
            self._slowness.add(now, seconds / expected)

    def slowness(self, now: float) -> float:
        """Calls take so many times as long as in the warm-up."""
        values = self._slowness.values(now)
        return median(values + [1.0] * (ENOUGH - len(values)))

    def seconds(self, rows: int) -> float:
        """One call for so many agents as in the warm-up, with as few candidates as measured there.

        Beyond all sizes that were measured the cost is unbounded.
        """
        return self._expected(Call(rows, min(self._warm, default=0)))

    def _expected(self, call: Call) -> float:
        """In the warm-up; between sizes measured there, in proportion. Infinite where unknown."""
        by_rows = sorted(self._warm.get(call.candidates, {}).items())
        if not by_rows or call.rows > by_rows[-1][0]:
            return inf
        rows, seconds = zip(*by_rows, strict=True)
        return float(np.interp(call.rows, rows, seconds))


class Rest:
    """What the loop does besides stepping: a line, fitted to its turns of the last seconds."""

    def __init__(self) -> None:
        self._seconds, self._chunks = Window(WINDOW), Window(WINDOW)

    def add(self, now: float, seconds: float, chunks: int) -> None:
        """A turn took so long, waiting and stepping aside, and published so many chunks."""
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


class Admission:
    """Decides whether more agents fit into the time there is. Thread-safe."""

    def __init__(self, settings: WorldSettings) -> None:
        """Until something is measured, nobody is refused."""
        self._rules = settings.admission
        self._sizes = settings.batch_sizes
        self._phases = settings.phases
        self._limit = settings.limits.agents
        self._costs = Costs()
        self._rest = Rest()
        self._steps = Window(WINDOW)
        self._lock = Lock()  # of the windows and the count
        self._capacity, self._counted_at = self._limit, -inf
        self.refused = 0  # agents so far

    def measured(self, rows: int, candidates: int, seconds: float) -> None:
        """An engine call of this size took so long in the warm-up."""
        self._costs.measured(Call(rows, candidates), seconds)

    def spent(self, now: float, call: Call, seconds: float) -> None:
        """A step with this call has taken so long."""
        with self._lock:
            self._costs.spent(now, call, seconds)
            self._steps.add(now, seconds)

    def worked(self, now: float, seconds: float, chunks: int) -> None:
        """A turn of the loop took so long, waiting and stepping aside; it published `chunks`."""
        with self._lock:
            self._rest.add(now, seconds, chunks)

    def load(self, now: float) -> float:
        """Share of the last seconds for which the motion thread was busy."""
        with self._lock:
            return (sum(self._steps.values(now)) + self._rest.total(now)) / WINDOW

    def check(self, phases: Phases, genders: Sequence[int], now: float, late: bool) -> None:
        """Agents of these genders are to be added. Raises ResourceExhausted when they do not fit.

        `late`: the ladder is at its end, whatever is predicted.
        """
        busy = self._busy(phases.with_agents(genders).groups, self._prices(now))
        if not genders or (not late and busy <= self._rules.most_load):
            return
        with self._lock:
            self.refused += len(genders)
        why = (
            "steps are late with all that could give way"
            if late
            else f"with them the motion thread would be busy for {busy:.0%} of the time, "
            f"allowed are {self._rules.most_load:.0%}"
        )
        fit = f" and {self.capacity(now)} fit on this machine now" if self._costs.known else ""
        raise ResourceExhausted(
            f"{phases.agents} agents exist{fit}; {len(genders)} more were asked for: {why}",
            retry_after=self._rules.retry_after,
        )

    def capacity(self, now: float) -> int:
        """So many agents fit, of both genders in turn; counted anew once a second. 0: not known."""
        if not self._costs.known:
            return 0
        if now - self._counted_at >= REFRESH:
            prices = self._prices(now)
            self._capacity = bisect_right(
                range(1, self._limit + 1),
                self._rules.most_load,
                key=lambda agents: self._busy(spread(agents, self._phases), prices),
            )
            self._counted_at = now
        return self._capacity

    def _prices(self, now: float) -> Prices:
        with self._lock:
            return Prices(self._costs.slowness(now), *self._rest.line(now))

    def _busy(self, groups: Sequence[int], prices: Prices) -> float:
        """Share of the time that the motion thread needs for agents in groups of one call each.

        Groups larger than the largest batch need several.
        """
        if not self._costs.known:
            return 0.0
        largest = self._sizes[-1]
        calls = [
            min(group - done, largest) for group in groups for done in range(0, group, largest)
        ]
        engine = sum(map(self._costs.seconds, calls)) * prices.slowness
        rest = len(calls) * prices.turn + sum(groups) * prices.chunk
        return (engine + rest) / STEP_SECONDS
