"""How much somebody lives who stands or walks: stillness, sway, glances, shifts of weight.

A statue has 100 % of still frames and 0 of everything else. World space, metres, Z up, 40 fps.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS

Array = NDArray[np.floating[Any]]

SMOOTH: Final = 5
"""Frames over which a velocity is averaged, so that noise of recordings does not count."""

STILL: Final = 0.01
"""Metres per second: a body none of whose joints is faster is a statue."""

WINDOW: Final = 3 * FPS
"""Frames of a window of sway and of glances: 3 s."""

SHIFTED: Final = 0.1
"""Share of the way between the feet, beyond the middle, to which the hips go in a shift."""


def smooth_speeds(places: Array) -> Array:
    """Speeds, m/s, of places [T, ..., 3] from mean velocities of 5 frames; [T - 5, ...].

    A mean velocity of 5 frames is the way from a frame to the fifth after it.
    """
    return np.linalg.norm(places[SMOOTH:] - places[:-SMOOTH], axis=-1) * FPS / SMOOTH


def still_share(joints: Array) -> float:
    """Share of frames in which none of joints [T, J, 3] is faster than 1 cm/s."""
    return float((smooth_speeds(joints).max(-1) < STILL).mean())


def median_speed(points: Array) -> float:
    """Median of the speeds, m/s, of points [T, P, 3], all of them together."""
    return float(np.median(smooth_speeds(points)))


def _windows(values: Array) -> Array:
    """Windows of 3 s, half overlapping, of values [T, ...]; all of it if it is shorter.
    [W, frames, ...]
    """
    frames = min(WINDOW, len(values))
    starts = range(0, len(values) - frames + 1, max(frames // 2, 1))
    return np.stack([values[start : start + frames] for start in starts])


def sway(hips: Array) -> float:
    """Root mean square of the horizontal distance, metres, of hips [T, 3] from their mean in 3 s;
    median over windows.
    """
    parts = _windows(hips[:, :2])
    away = ((parts - parts.mean(1, keepdims=True)) ** 2).sum(-1).mean(1)
    return float(np.median(np.sqrt(away)))


def range_in_window(degrees: Array) -> float:
    """Range of an angle [T] in 3 s; median over windows."""
    return float(np.median(np.ptp(_windows(degrees), axis=1)))


def yaw_against(turned: Array, base: Array) -> Array:
    """Degrees about the base's up axis by which joints are turned against it, to the left.

    Both [T, 3, 3], world rotations with columns right, forward, up. [T]
    """
    forward = np.einsum("tji,tj->ti", base, turned[:, :, 1])
    return np.degrees(np.unwrap(np.arctan2(-forward[:, 0], forward[:, 1])))


def weight_shifts(hips: Array, ankles: Array) -> float:
    """Times a minute that the hips [T, 3] go from one foot's side to the other's; ankles [T, 2, 3].

    0 is over the left foot and 1 over the right one. A shift ends beyond .6 or below .4, after a
    mean over half a second. NaN for feet together, of which nobody can tell.
    """
    across = (ankles[:, 1] - ankles[:, 0])[:, :2]
    square = (across**2).sum(-1)
    if square.min() < 0.05**2:
        return float("nan")
    share = ((hips - ankles[:, 0])[:, :2] * across).sum(-1) / square
    frames = min(FPS // 2, len(share))
    share = np.convolve(share, np.ones(frames) / frames, "valid")
    sides = np.where(share > 0.5 + SHIFTED, 1, np.where(share < 0.5 - SHIFTED, -1, 0))
    taken = sides[sides != 0]
    shifts = int((np.diff(taken) != 0).sum())
    return shifts * 60 * FPS / len(hips)
