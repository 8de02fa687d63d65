"""How many agents fit, by the measured costs of engine calls and of the rest of the loop.

The engine and the motion thread work concurrently. Agents are admitted as long as neither, on the
last degradation level that still steps all agents (one candidate), would be busy for more than a
share of the time. In 0.2 s the engine has a call for each batch of one gender, which is filled with
the agents that come next. The motion thread has a fixed cost per call and per chunk; sending a
chunk costs about the same again. CPU used by these two is not available to the engine.

    thread = (calls · a + chunks · b) / 0.2 s
    engine = excess · Σ over calls of their seconds in the warm-up / 0.2 s / (1 - 2 thread / cores)

*a*, *b* and *excess* are measured (`costs.py`).
"""

from bisect import bisect_right
from collections.abc import Sequence
from math import inf, isfinite
from threading import Lock
from typing import Final, NamedTuple

from wayfarer.errors import ResourceExhausted
from wayfarer.spec import GENDERS, STEP_SECONDS
from wayfarer.world.stepping.costs import WINDOW, Excess, Rest, WarmCalls, Weighted
from wayfarer.world.stepping.engine_call import Call
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.stepping.window import Window

REFRESH: Final = 1.0
"""Seconds after which the number of agents that fit is computed again."""

MOST_REPORTED: Final = 10.0
"""Maximum projected load that is reported; the load itself may be infinite."""

BESIDE: Final = 2.0
"""Ratio of the CPU that loop and transport use together to the loop's."""


class Prices(NamedTuple):
    """Present costs."""

    excess: float  # ratio of measured to expected engine time
    turn: float  # seconds of the motion thread per engine call
    chunk: float  # seconds of the motion thread per chunk that it publishes


class Admission:
    """Decides whether more agents fit into the available time. Thread-safe."""

    def __init__(self, settings: WorldSettings) -> None:
        """Refuses nobody before something has been measured."""
        self._rules = settings.admission
        self._limit = settings.limits.agents
        largest, full = settings.batch_sizes[-1], settings.batch_multiple
        self._cores = settings.cores
        self._warm = WarmCalls(largest // full * full or largest)
        self._excess = Excess()
        self._rest = Rest()
        self._steps = Window(WINDOW)
        self._lock = Lock()  # of the windows and the count
        self._capacity, self._counted_at = self._limit, -inf
        self._line, self._fitted_at = self._rest.line(-inf), -inf
        self.refused = 0  # agents so far

    def measured(self, rows: int, candidates: int, seconds: float) -> None:
        """Records that an engine call of this size took `seconds` in the warm-up."""
        self._warm.measured(rows, candidates, seconds)

    def spent(self, now: float, call: Call, stepped: int, seconds: float, agents: Weighted) -> None:
        """Records that a call for `stepped` of the agents took `seconds`."""
        with self._lock:
            self._steps.add(now, seconds)
            if now - self._fitted_at >= REFRESH:
                self._line, self._fitted_at = self._rest.line(now), now
            thread = self._thread(agents, *self._line)
            usual = self._warm.call(call.rows, call.candidates)
            of_all = self._engine(self._warm.share(agents, call.candidates), thread) * STEP_SECONDS
            if isfinite(usual + of_all) and any(agents):
                self._excess.add(now, seconds, of_all * stepped / sum(agents), usual)

    def worked(self, now: float, seconds: float, chunks: int) -> None:
        """Records a turn's `seconds`, without waiting and stepping, and its published `chunks`."""
        with self._lock:
            self._rest.add(now, seconds, chunks)

    def load(self, now: float) -> float:
        """Share of the last seconds for which the busier of engine and thread was busy."""
        with self._lock:
            return max(sum(self._steps.values(now)), self._rest.total(now)) / WINDOW

    def check(self, agents: Weighted, coming: Sequence[int], now: float, late: bool) -> None:
        """Checks room for more agents of these genders. Raises ResourceExhausted if they do not
        fit.

        `late`: the ladder is at its end, whatever the prediction.
        """
        busy = self._busy(with_more(agents, coming), self._prices(now))
        if not coming or (not late and busy <= self._rules.most_load):
            return
        with self._lock:
            self.refused += len(coming)
        if late:
            why = f"{_used(agents)}, and steps come late with all that can give way"
        else:
            # fewer of these genders fit than were requested, even if a mix of both would fit
            fit = min(self.capacity(now), sum(agents) + len(coming) - 1)
            load = f"{busy:.0%}" if busy < MOST_REPORTED else f"more than {MOST_REPORTED:.0%}"
            why = (
                f"{_used(agents, f' of about {fit:g}')}, and the projected load would be {load} "
                f"(limit {self._rules.most_load:.0%})"
            )
        many = "1 agent" if len(coming) == 1 else f"{len(coming)} agents"
        raise ResourceExhausted(f"cannot add {many}: {why}", retry_after=self._rules.retry_after)

    def capacity(self, now: float) -> int:
        """Number of agents that fit, genders in turn; computed once a second. 0: unknown."""
        if not self._warm.known:
            return 0
        if now - self._counted_at >= REFRESH:
            prices = self._prices(now)
            self._capacity = bisect_right(
                range(1, self._limit + 1),
                self._rules.most_load,
                key=lambda agents: self._busy(in_turn(agents), prices),
            )
            self._counted_at = now
        return self._capacity

    def _prices(self, now: float) -> Prices:
        with self._lock:
            return Prices(self._excess.value(now), *self._rest.line(now))

    def _busy(self, agents: Weighted, prices: Prices) -> float:
        """Share of the time that the busier of engine and thread needs."""
        if not self._warm.known:
            return 0.0
        thread = self._thread(agents, prices.turn, prices.chunk)
        return max(prices.excess * self._engine(self._warm.share(agents), thread), thread)

    def _thread(self, agents: Weighted, turn: float, chunk: float) -> float:
        """Share of the time that the motion thread needs."""
        return (self._warm.count(agents) * turn + sum(agents) * chunk) / STEP_SECONDS

    def _engine(self, alone: float, thread: float) -> float:
        """Share of the time that the engine needs beside the thread; `alone` without the thread."""
        left = 1 - BESIDE * thread / self._cores
        return alone / left if left > 0 else inf


def _used(agents: Weighted, of_all: str = "") -> str:
    """The number in use; not a whole number, since agents far away count for less."""
    count = sum(agents)
    if count % 1:
        return f"the agents in use count as {count:g}{of_all}"
    return f"{count:g}{of_all} are in use"


def with_more(agents: Weighted, genders: Sequence[int]) -> list[float]:
    """Counts including further agents of these genders."""
    return [count + genders.count(gender) for gender, count in enumerate(agents)]


def in_turn(agents: int) -> list[int]:
    """Counts of `agents` agents, genders in turn."""
    return [len(range(gender, agents, len(GENDERS))) for gender in range(len(GENDERS))]
