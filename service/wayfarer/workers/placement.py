"""Which worker a session lives in."""

import time
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Sequence
from typing import Final, Protocol

from wayfarer.errors import Unavailable
from wayfarer.workers.messages import Report
from wayfarer.workers.shares import worker_of

UNSEEN_S: Final = 2.0
"""Seconds after which a placed session is in the reports."""

REMEMBERED: Final = 4096
"""Request ids whose worker is known, so that a create sent twice meets its first reply."""


class Reporting(Protocol):
    """What is known of a worker."""

    @property
    def report(self) -> Report:
        """The last one; DOWN while it does not run."""
        ...


class Placement:
    """New sessions go to the ready worker with the fewest people.

    Agents come only after their session, and reports later still. So a session counts as the mean
    one holds, whatever it holds yet, beside the agents that are there; and it counts at once.
    """

    def __init__(
        self, workers: Sequence[Reporting], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._workers = workers
        self._clock = clock
        self._placed: deque[tuple[float, int]] = deque()  # when, and to which worker
        self._chosen: OrderedDict[str, int] = OrderedDict()  # by request id, the oldest first

    def choose(self, request_id: str = "") -> int:
        """The least loaded worker, which counts from now on; or where the request went before."""
        if request_id in self._chosen:
            return self._chosen[request_id]
        index = self.any()
        self._placed.append((self._clock(), index))
        if request_id:
            self._chosen[request_id] = index
            if len(self._chosen) > REMEMBERED:
                self._chosen.popitem(last=False)
        return index

    def any(self) -> int:
        """The least loaded worker."""
        ready = [i for i, worker in enumerate(self._workers) if worker.report.ready]
        if not ready:
            raise Unavailable("no worker is ready; they are starting or stopping")
        reports = [worker.report for worker in self._workers]
        sessions = sum(report.sessions for report in reports)
        mean = max(1.0, sum(report.agents for report in reports) / max(1, sessions))
        unseen = self._unseen()
        return min(
            ready, key=lambda i: reports[i].agents + mean * (reports[i].sessions + unseen[i])
        )

    def find(self, name: str) -> int:
        """The worker that the id itself names."""
        return worker_of(name, len(self._workers))

    def _unseen(self) -> Counter[int]:
        """Placed sessions that may not be in the reports yet, by worker."""
        while self._placed and self._placed[0][0] < self._clock() - UNSEEN_S:
            self._placed.popleft()
        return Counter(index for _, index in self._placed)
