"""Lean into a curve, and what physics asks for. World space, metres, Z up, 40 fps. T frames."""

from math import nan
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS

Array = NDArray[np.floating[Any]]

GRAVITY: Final = 9.81
ENOUGH: Final = 1.5
"""Degrees of lean that physics has to ask for, so that a share of it means anything."""


def inward(ankles: Array, head: Array, hips: Array, turn: float) -> float:
    """Mean degrees that a body leans into a curve: the head [T, 3] over the middle of both ankles
    [T, 2, 3], across the way of the hips [T, 3]. `turn`: 1 to the left, -1 to the right.
    """
    along = np.gradient(hips[:, :2], axis=0)
    along = _smooth(along)
    along /= np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-9)
    left = np.stack([-along[:, 1], along[:, 0]], -1)
    line = head - ankles.mean(1)
    aside = _smooth((line[:, :2] * left).sum(-1)) * turn
    return float(np.degrees(np.arctan2(aside, line[:, 2])).mean())


def asked(hips: Array) -> float:
    """Mean degrees that physics asks for, atan(v ω / g), of the smoothed way of hips [T, 3]."""
    velocity = _smooth(np.gradient(hips[:, :2], axis=0) * FPS)
    way = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    speed, turning = np.linalg.norm(velocity, axis=-1), _smooth(np.gradient(way) * FPS)
    return float(np.degrees(np.arctan(speed * turning / GRAVITY)).mean())


def share_of_asked(ankles: Array, head: Array, hips: Array) -> float:
    """Inward lean over what physics asks for; NaN where that is less than 1.5°."""
    wanted = asked(hips)
    if abs(wanted) < ENOUGH:
        return nan
    return inward(ankles, head, hips, float(np.sign(wanted))) / abs(wanted)


def _smooth(values: Array) -> Array:
    """Moving mean over a second of values [T, ...]; shorter at the ends."""
    frames = min(FPS, len(values))
    kernel = np.ones(frames)
    count = np.convolve(np.ones(len(values)), kernel, "same")
    flat = values.reshape(len(values), -1)
    means = np.stack([np.convolve(column, kernel, "same") / count for column in flat.T], -1)
    return means.reshape(values.shape)
