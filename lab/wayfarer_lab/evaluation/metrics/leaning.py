"""Lean into a curve, and what physics asks for. World space, metres, Z up, 40 fps. T frames."""

from math import nan
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS

Array = NDArray[np.floating[Any]]

GRAVITY: Final = 9.81
MIN_LEAN_DEG: Final = 1.5
"""Degrees of lean that physics has to ask for, so that a share of it means anything."""


def inward(ankles: Array, head: Array, hips: Array, turn: float) -> float:
    """Mean degrees that a body leans into a curve: the head [T, 3] over the middle of both ankles
    [T, 2, 3], across the way of the hips [T, 3], means over a second. `turn`: 1 to the left, -1 to
    the right. NaN for less than a second.
    """
    velocity = _means(np.gradient(hips[:, :2], axis=0))
    along = velocity / np.maximum(np.linalg.norm(velocity, axis=-1, keepdims=True), 1e-9)
    left = np.stack([-along[:, 1], along[:, 0]], -1)
    line = _means(head - ankles.mean(1))
    aside = turn * (line[:, :2] * left).sum(-1)
    return float(np.degrees(np.arctan2(aside, line[:, 2])).mean()) if len(line) else nan


def asked(hips: Array) -> float:
    """Degrees that physics asks for, atan(v ω / g), of the way of hips [T, 3], means over a second;
    positive to the left. NaN for less than a second and two frames.
    """
    velocity = _means(np.gradient(hips[:, :2], axis=0) * FPS)
    if len(velocity) < 2:
        return nan
    way = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    turning = float(way[-1] - way[0]) * FPS / (len(way) - 1)
    speed = float(np.linalg.norm(velocity, axis=-1).mean())
    return float(np.degrees(np.arctan(speed * turning / GRAVITY)))


def share_of_asked(ankles: Array, head: Array, hips: Array) -> float:
    """Inward lean over what physics asks for; NaN where that is less than 1.5°."""
    wanted = asked(hips)
    if not abs(wanted) >= MIN_LEAN_DEG:
        return nan
    return inward(ankles, head, hips, float(np.sign(wanted))) / abs(wanted)


def _means(values: Array) -> Array:
    """Means of values [T, D] over every second, [T - 39, D]: whole strides, no ends."""
    total = np.concatenate([np.zeros((1, values.shape[1])), values.cumsum(0)])
    return (total[FPS:] - total[:-FPS]) / FPS
