"""Values over the last seconds."""

from collections import deque

import numpy as np


class Window:
    """Values of the last `seconds`."""

    def __init__(self, seconds: float = 10.0) -> None:
        self._seconds = seconds
        self._values: deque[tuple[float, float]] = deque()

    def add(self, now: float, value: float) -> None:
        """Adds a value."""
        self._values.append((now, value))
        self._forget(now)

    def values(self, now: float) -> list[float]:
        """Values added within the window, oldest first."""
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
