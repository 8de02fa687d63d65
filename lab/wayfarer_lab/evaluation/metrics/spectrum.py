"""Power of movement by frequency band: with too little at high frequencies a walk looks
rubbery, with too much it shakes.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from wayfarer.spec import FPS

Array = NDArray[np.floating[Any]]

WINDOW: Final = 64
"""Frames of a Hann window; they overlap by half. Bins are 0.625 Hz wide."""

BANDS: Final = ((0.4, 3.0), (3.0, 6.0), (6.0, 10.0), (10.0, 20.0))
"""Hz; a bin belongs to the band in which its middle lies."""


def band_power(places: Array) -> Array:
    """Mean square velocity in each of `BANDS`, (m/s)², of places [T, J, 3]: of all three axes
    together, mean over J. NaN for less than a window. [4]

    (Welch's method: the mean velocity of each window is taken off.)
    """
    return velocity_power(np.diff(places, axis=0) * FPS)


def velocity_power(velocity: Array) -> Array:
    """Mean square of velocities [T, J, 3] in each of `BANDS`, summed over axes, mean over J. [4]"""
    if len(velocity) < WINDOW:
        return np.full(len(BANDS), np.nan)
    frequency, density = welch(velocity, FPS, "hann", WINDOW, detrend="constant", axis=0)
    power = density.sum(-1).mean(-1) * (frequency[1] - frequency[0])
    return np.array([power[(frequency >= low) & (frequency < high)].sum() for low, high in BANDS])
