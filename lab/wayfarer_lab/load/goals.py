"""Goal latency: from the instant planned for a goal to the first pose planned for it."""

from collections import defaultdict

from wayfarer_lab.load.tally import Tally

UNANSWERED_S = 1.0
"""A goal older than this without a pose at the end counts as unanswered."""


class GoalWatch:
    """The goals of one session's agents. Times: Unix seconds."""

    def __init__(self, tally: Tally) -> None:
        self._tally = tally
        self._asked: defaultdict[int, dict[int, float]] = defaultdict(dict)  # alias: revision: when
        self._shown: dict[int, tuple[int, float]] = {}  # alias: newest revision, first seen when

    def asked(self, alias: int, revision: int, since: float) -> None:
        """A goal that was to be given at `since` has been answered with its revision."""
        shown, when = self._shown.get(alias, (-1, 0.0))
        if shown >= revision:  # its first chunk was quicker than the answer
            self._tally.goal_latency.add(when - since)
        else:
            self._asked[alias][revision] = since

    def seen(self, alias: int, revision: int, now: float) -> None:
        """A pose planned for this revision has come. A newer goal answers for those it replaced."""
        if self._shown.get(alias, (-1, 0.0))[0] >= revision:
            return
        self._shown[alias] = (revision, now)
        waiting = self._asked[alias]
        for known in [r for r in waiting if r <= revision]:
            self._tally.goal_latency.add(now - waiting.pop(known))

    def finish(self, now: float) -> None:
        """Count the goals without a pose, as late as they are by now."""
        for waiting in self._asked.values():
            for since in waiting.values():
                if now - since > UNANSWERED_S:
                    self._tally.unanswered += 1
                    self._tally.goal_latency.add(now - since)
