"""Seconds and world frames: 40 frames per second since time 0."""

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS


class Timeline:
    """The clock face of a world; the time itself is always an argument."""

    def frame(self, time: float) -> float:
        """World frame shown at `time`; the small term absorbs rounding of Unix seconds."""
        return time * FPS + 1e-3

    def time(self, frame: float) -> float:
        """The time at which a world frame is shown."""
        return frame / FPS

    def times(self, frames: NDArray[np.int64]) -> NDArray[np.float64]:
        """`time` of several world frames."""
        return frames / FPS
