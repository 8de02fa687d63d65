"""Small figures of trajectories, and averages over values of which NaN means "never happened"."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS
from wayfarer.world.agents.goal import Goal

Array = NDArray[np.floating[Any]]


def distances(hips: Array, place: Goal | Array) -> Array:
    """Horizontal metres from hips [..., 3] to a goal or a point. [...]"""
    point = np.asarray(place.position if isinstance(place, Goal) else place)
    return np.linalg.norm(hips[..., :2] - point[..., :2], axis=-1)


def degrees_off(facing: Array, target: Array | tuple[float, float]) -> Array:
    """Degrees, 0 … 180, between horizontal unit vectors [..., 2]. [...]"""
    return np.degrees(np.arccos(np.clip((facing * np.asarray(target)).sum(-1), -1.0, 1.0)))


def smooth_speed(hips: Array, seconds: float = 0.5) -> Array:
    """Horizontal speed, m/s, over `seconds` around each frame of hips [T, 3], about a step of a
    walk, so that its rhythm hardly shows; less at both ends. [T]
    """
    reach = round(seconds * FPS / 2)
    time = np.arange(len(hips))
    before, after = np.maximum(time - reach, 0), np.minimum(time + reach, len(hips) - 1)
    way = np.linalg.norm(hips[after, :2] - hips[before, :2], axis=-1)
    return way * FPS / np.maximum(after - before, 1)


def first(happens: NDArray[np.bool_]) -> int | None:
    """The first frame that is true."""
    return int(happens.argmax()) if happens.any() else None


def mean(values: Sequence[float]) -> float:
    """Mean of the values that are not NaN; NaN if all are."""
    known = [v for v in values if not np.isnan(v)]
    return float(np.mean(known)) if known else float("nan")


def quantile(values: Sequence[float], at: float) -> float:
    """Quantile of the values that are not NaN; NaN if all are."""
    known = [v for v in values if not np.isnan(v)]
    return float(np.quantile(known, at)) if known else float("nan")


def share(happened: Sequence[bool]) -> float:
    """Share of the values that are not NaN."""
    return sum(happened) / len(happened)
