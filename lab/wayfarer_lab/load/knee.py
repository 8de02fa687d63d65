"""The knee: the most agents that are served in time, found by bisection."""

from collections.abc import Awaitable, Callable
from typing import Any

FAULTS = ("misses", "refused", "held", "reduced", "malformed", "repeated", "popped")

Trial = Callable[[int], Awaitable[dict[str, Any]]]


def in_time(summary: dict[str, Any], p99_ms: float) -> bool:
    """All admitted, no primitive missed, and p99 of lateness within the limit.

    Quality must not suffer: no agent held, none with fewer candidates.
    """
    lateness = summary["lateness_ms"]
    fits = lateness is not None and lateness["p99"] <= p99_ms
    return bool(fits and not any(summary[fault] for fault in FAULTS))


async def find_knee(
    trial: Trial, most: int, p99_ms: float, tolerance: float = 0.05
) -> tuple[int, list[dict[str, Any]]]:
    """The most agents up to `most` served in time, to `tolerance`, and all trials.

    `trial(agents)` makes a run and returns its summary. 0 when not even one agent is served.
    """
    trials: list[dict[str, Any]] = []

    async def served(agents: int) -> bool:
        trials.append(await trial(agents))
        return in_time(trials[-1], p99_ms)

    if await served(most):
        return most, trials
    good, bad = 0, most
    while bad - good > max(1, tolerance * bad):
        middle = (good + bad) // 2
        good, bad = (middle, bad) if await served(middle) else (good, middle)
    return good, trials
