"""The ladder: what is left out when engine calls no longer meet their deadlines.

Frames must be ready in time under any load, so quality is reduced first:

    by sight              agents seen as a root, or not at all, coast: they continue without the
                          model (REDUCED); among the others, distant agents come last
    fewer candidates      the search tries 16, 8, 4, 2, 1 instead of the requested number (REDUCED)
    hold idle agents      standing agents with nothing to do keep their pose, unstepped     (HELD)
    refuse new agents     ResourceExhausted

The level goes down one at a time when late calls do not catch up by themselves, and up again after
a calm period. Time is an argument.
"""

from dataclasses import dataclass, replace

from wayfarer.world.stepping.window import Window

COUNTS = (16, 8, 4, 2, 1)

BY_SIGHT = 1
"""Number of the level that differs from the one above only if some agents are not near."""

WINDOW = 1.0
"""Seconds of calls that are considered. After a longer time a late call counts as the first."""


@dataclass(frozen=True, slots=True)
class DegradationLevel:
    """The work for which there is time."""

    candidates: int  # maximum to try
    by_sight: bool = False  # near agents first; agents seen at most as a root coast
    hold_idle: bool = False
    refuse: bool = False


def candidate_counts(most: int) -> tuple[int, ...]:
    """The candidate counts to choose from if steering requests `most`."""
    return (most, *(k for k in COUNTS if k < most))


def ladder(most: int) -> tuple[DegradationLevel, ...]:
    """All levels, best first."""
    last = DegradationLevel(1, by_sight=True, hold_idle=True)
    return (
        DegradationLevel(most),
        *(DegradationLevel(count, by_sight=True) for count in candidate_counts(most)),
        last,
        replace(last, refuse=True),
    )


@dataclass(frozen=True, slots=True)
class BudgetRules:
    """When to go down the ladder, and when up again, in seconds."""

    late: float = 0.03  # an engine call may end this long after its deadline
    settle: float = 0.2  # time to catch up: what is then still more than half as late will not
    hurry: float = 0.06  # a call that ends this late is enough, half of `settle` after a change
    patience: float = 3.0  # wait before a change up; doubled after each climb that was a mistake
    most_patience: float = 60.0  # upper bound of that wait; a level held this long resets it
    headroom: float = 1.6  # ratio of a call's cost with the next level's candidates
    most_busy: float = 1.25  # maximum share of the time it may then take to be worth trying


class Budget:
    """One world's place on the ladder.

    A busy engine is no reason to go down: it works concurrently, and all is well while every call
    ends in time. Only a trial shows whether there is room one level up.
    """

    def __init__(self, most: int, rules: BudgetRules) -> None:
        self._levels = ladder(most)
        self._rules = rules
        self.number = 0  # of the level, from the top
        self._changed_at = float("-inf")
        self._late_at = float("-inf")  # when a call was late, and by how much too late
        self._late = 0.0
        self._climbed_at = float("-inf")
        self._is_trial = False  # whether it has not gone down since the climb
        self._patience = rules.patience
        self._calls = Window(WINDOW)

    @property
    def level(self) -> DegradationLevel:
        """The present level."""
        return self._levels[self.number]

    def spent(self, now: float, seconds: float) -> None:
        """Records that an engine call took `seconds`."""
        self._calls.add(now, seconds)

    def allow(
        self, now: float, slack: float, held: float = 0.0, ahead: int = 0, distant: bool = False
    ) -> DegradationLevel:
        """The level for a call that begins now, `slack` seconds before its deadline.

        `held`: share of the agents, below 1, that are held at present. `ahead`: calls in progress
        before it. `distant`: whether some agents are not near.
        """
        rules, since = self._rules, now - self._changed_at
        calls = sorted(self._calls.values(now))
        # calls have few rows or many: three quarters of them take no longer
        call, busy = (calls[len(calls) * 3 // 4], sum(calls)) if calls else (0.0, 0.0)
        slack -= max(ahead - 0.5, 0.0) * call  # the first of them is half done
        late = call - rules.late - slack
        if late > 0:
            waited = now - self._late_at
            if late > rules.hurry - rules.late:
                falls = since >= rules.settle / 2
            else:
                falls = rules.settle <= waited <= WINDOW and late > self._late / 2
            if falls and self.number < len(self._levels) - 1:
                self._fall(now, distant)
            if falls or waited >= rules.settle:
                self._late_at, self._late = now, late
        elif self.number > 0 and since >= self._patience:
            longer, more = self._growth(held)
            fits = slack >= call * longer - rules.late
            if fits and busy * longer * more <= rules.most_busy * WINDOW:
                self.number, self._changed_at = self._other(-1, distant), now
                self._climbed_at, self._is_trial = now, True
        return self.level

    def _growth(self, held: float) -> tuple[float, float]:
        """Factors of one level up: on the time of a call, and on the number of calls."""
        above = self._levels[self.number - 1]
        calls_distant = self.number == BY_SIGHT
        releases = calls_distant or (self.level.hold_idle and not above.hold_idle)
        tries_more = above.candidates > (1 if calls_distant else self.level.candidates)
        return (
            self._rules.headroom if tries_more else 1.0,
            1 / (1 - min(held, 0.99)) if releases else 1.0,
        )

    def _other(self, way: int, distant: bool) -> int:
        """The next level up (-1) or down (1) that changes something."""
        number = self.number + way
        return number + way if number == BY_SIGHT and not distant else number

    def _fall(self, now: float, distant: bool) -> None:
        rules, since = self._rules, now - self._climbed_at
        # a second fall right after the first one reveals nothing new about that climb
        if since >= rules.most_patience:
            self._patience = rules.patience
        elif self._is_trial:
            self._patience = min(2 * self._patience, rules.most_patience)
        self._is_trial = False
        self.number, self._changed_at = self._other(1, distant), now
