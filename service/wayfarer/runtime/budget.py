"""How many candidates the search may try: fewer when engine calls no longer fit before deadlines.

Frames must be there at their time whatever the load; quality gives way first. Time is an argument.
"""

from dataclasses import dataclass
from statistics import median

from wayfarer.runtime.stats import Window

LADDER = (16, 8, 4, 2, 1)


def rungs(most: int) -> tuple[int, ...]:
    """Numbers of candidates that may be tried where steering wishes for `most`."""
    return (most, *(k for k in LADDER if k < most))


@dataclass(frozen=True, slots=True)
class BudgetRules:
    """When to go down the ladder, and when up again. Seconds."""

    margin: float = 0.03  # an engine call has to be over so long before its deadline
    settle: float = 0.2  # after a change, so long before the next one down …
    patience: float = 3.0  # … or up
    headroom: float = 2.2  # a call with the candidates of the next rung takes so much longer …
    most_busy: float = 0.8  # … and the engine must then be idle for the rest of the time


class Budget:
    """The ladder that one world stands on."""

    def __init__(self, most: int, rules: BudgetRules) -> None:
        self._rungs = rungs(most)
        self._rules = rules
        self._rung = 0
        self._changed_at = float("-inf")
        self._calls = Window(1.0)

    def spent(self, now: float, seconds: float) -> None:
        """An engine call that took so long has ended."""
        self._calls.add(now, seconds)

    def candidates(self, now: float, slack: float) -> int:
        """The most to try in a call that begins now, `slack` seconds before its deadline."""
        rules, since = self._rules, now - self._changed_at
        calls = self._calls.values(now)
        call, busy = (median(calls), sum(calls)) if calls else (0.0, 0.0)
        if slack < call + rules.margin:
            if since >= rules.settle and self._rung < len(self._rungs) - 1:
                self._rung, self._changed_at = self._rung + 1, now
        elif (
            self._rung > 0
            and since >= rules.patience
            and busy * rules.headroom <= rules.most_busy
            and slack >= call * rules.headroom + rules.margin
        ):
            self._rung, self._changed_at = self._rung - 1, now
        return self._rungs[self._rung]
