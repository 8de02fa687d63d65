"""Figures of the loop over the last seconds."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from wayfarer.runtime.agent import AgentState


@dataclass(frozen=True, slots=True)
class LoopStats:
    """Health of the loop over the last few seconds."""

    agents: int
    sessions: int
    subscribers: int
    steps: int  # agent steps since start
    step_ms_mean: float  # one engine call
    step_ms_p95: float
    late_chunks: int  # chunks ready after their scheduled time, since start
    lateness_ms_p95: float
    uptime_s: float
    resets: int = 0  # agents put back to a stand because their step was broken, since start
    failures: int = 0  # turns of the loop that raised, since start
    rebased: int = 0  # how often the schedule was moved because the loop was > 1 s behind
    dropped_batches: int = 0  # lost by the present subscribers, who were too slow
    reduced_steps: int = 0  # agent steps with fewer candidates than wished, since start
    held_sessions: int = 0  # whose agents wait for a subscriber now
    states: Mapping[AgentState, int] = field(default_factory=dict)  # agents in each
    capacity: int = 0  # agents that fit, by the measured cost of a step; 0: not known yet
    load: float = 0.0  # share of the last seconds: the engine, or if busier the motion thread
    rung: int = 0  # of the overload ladder: 0 is its top, where all is as wished
    held_steps: int = 0  # agent steps left out because time was short and they idle, since start
    refused_agents: int = 0  # not created, because they could not be stepped in time, since start
    journal_failing: bool = False  # nothing that changes now would survive the process


class Window:
    """Values of the last `seconds`."""

    def __init__(self, seconds: float = 10.0) -> None:
        self._seconds = seconds
        self._values: deque[tuple[float, float]] = deque()

    def add(self, now: float, value: float) -> None:
        """Note a value."""
        self._values.append((now, value))
        self._forget(now)

    def values(self, now: float) -> list[float]:
        """What was noted within the window, oldest first."""
        self._forget(now)
        return [value for _, value in self._values]

    def _forget(self, now: float) -> None:
        while self._values and self._values[0][0] < now - self._seconds:
            self._values.popleft()


def mean(values: list[float]) -> float:
    """0 for none."""
    return float(np.mean(values)) if values else 0.0


def percentile(values: list[float], share: float) -> float:
    """`share` in percent; 0 for none."""
    return float(np.percentile(values, share)) if values else 0.0
