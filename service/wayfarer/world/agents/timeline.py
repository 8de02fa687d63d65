"""Seconds and world frames: 40 frames per second, counted from an epoch that may be moved."""

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS


class Timeline:
    """The clock face of a world; the time itself is always an argument."""

    def __init__(self) -> None:
        self._epoch = 0.0  # time of world frame 0

    def frame(self, time: float) -> float:
        """World frame shown at `time`; the small term absorbs rounding of Unix seconds."""
        return (time - self._epoch) * FPS + 1e-3

    def time(self, frame: float) -> float:
        """When a world frame is shown."""
        return self._epoch + frame / FPS

    def times(self, frames: NDArray[np.int64]) -> NDArray[np.float64]:
        """`time` of several world frames."""
        return self._epoch + frames / FPS

    def move(self, seconds: float) -> None:
        """Show every frame `seconds` later."""
        self._epoch += seconds
