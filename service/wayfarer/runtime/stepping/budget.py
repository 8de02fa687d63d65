"""What gives way when engine calls no longer fit before their deadlines: the ladder.

Frames must be there at their time whatever the load; quality gives way first:

    fewer candidates      the search tries 16, 8, 4, 2, 1 in place of what is wished  (REDUCED)
    hold idle agents      who stands with nothing to do keeps its pose, unstepped     (HELD)
    refuse new agents     ResourceExhausted

One goes down a rung at a time, and up again after a calm while. Time is an argument.
"""

from dataclasses import dataclass
from statistics import median

from wayfarer.runtime.stats import Window

COUNTS = (16, 8, 4, 2, 1)

WINDOW = 1.0
"""Seconds over which calls are looked at."""


@dataclass(frozen=True, slots=True)
class Rung:
    """What there is time for."""

    candidates: int  # the most to try
    hold_idle: bool = False
    refuse: bool = False


def rungs(most: int) -> tuple[int, ...]:
    """Numbers of candidates that may be tried where steering wishes for `most`."""
    return (most, *(k for k in COUNTS if k < most))


def ladder(most: int) -> tuple[Rung, ...]:
    """All rungs, from the top."""
    return (*map(Rung, rungs(most)), Rung(1, hold_idle=True), Rung(1, hold_idle=True, refuse=True))


@dataclass(frozen=True, slots=True)
class BudgetRules:
    """When to go down the ladder, and when up again. Seconds."""

    margin: float = 0.03  # an engine call has to be over so long before its deadline
    settle: float = 0.2  # after a change, so long before the next one down …
    patience: float = 3.0  # … or up
    headroom: float = 1.6  # a call with the candidates of the next rung takes so much longer …
    most_busy: float = 0.8  # … and the engine must then be idle for the rest of the time
    too_busy: float = 0.9  # share of the time for calls at which something gives way in any case


class Budget:
    """The ladder that one world stands on."""

    def __init__(self, most: int, rules: BudgetRules) -> None:
        self._rungs = ladder(most)
        self._rules = rules
        self.number = 0  # of the rung, from the top
        self._changed_at = float("-inf")
        self._calls = Window(WINDOW)

    @property
    def rung(self) -> Rung:
        """Where it stands now."""
        return self._rungs[self.number]

    def spent(self, now: float, seconds: float) -> None:
        """An engine call that took so long has ended."""
        self._calls.add(now, seconds)

    def allow(self, now: float, slack: float, held: float = 0.0, ahead: int = 0) -> Rung:
        """The rung for a call that begins now, `slack` seconds before its deadline.

        `held` is the share of the agents, below 1, who are held at present; so many calls `ahead`
        of it are under way.
        """
        rules, since = self._rules, now - self._changed_at
        calls = self._calls.values(now)
        call, busy = (median(calls), sum(calls)) if calls else (0.0, 0.0)
        slack -= ahead * call
        is_crowded = since >= WINDOW and call * len(calls) > rules.too_busy * WINDOW
        if slack < call + rules.margin or is_crowded:
            if since >= rules.settle and self.number < len(self._rungs) - 1:
                self._move(now, 1)
        elif self.number > 0 and since >= rules.patience:
            longer, more = self._growth(held)
            fits = slack >= call * longer + rules.margin
            if fits and busy * longer * more <= rules.most_busy * WINDOW:
                self._move(now, -1)
        return self.rung

    def _growth(self, held: float) -> tuple[float, float]:
        """One rung up a call takes so many times as long, and there are so many times more."""
        above = self._rungs[self.number - 1]
        if above.candidates > self.rung.candidates:
            return self._rules.headroom, 1.0
        releases = self.rung.hold_idle and not above.hold_idle
        return 1.0, 1 / (1 - min(held, 0.99)) if releases else 1.0

    def _move(self, now: float, by: int) -> None:
        self.number, self._changed_at = self.number + by, now
