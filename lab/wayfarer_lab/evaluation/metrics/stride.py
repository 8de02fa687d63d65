"""The rhythm of a steady, straight walk: strikes, steps, and the swing of body parts.

A strike is the moment in which an ankle is farthest ahead of the hips (Zeni, Richards and
Higginson 2008, "Two simple methods for determining gait events"): it needs no floor and no
threshold of speed. Places are [T, 3], world, metres, at 40 fps. Left comes before right.
"""

import itertools
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from wayfarer.spec import FPS

Array = NDArray[np.floating[Any]]

MIN_STRIDE: Final = round(0.45 * FPS)
"""Frames from a strike of a foot to its next at least: 133 strides a minute, beyond any run."""

MIN_SWING: Final = 0.05
"""Least swing of a foot relative to the hips, in metres."""

MIN_STRIKES: Final = 4
"""Least number of strikes of a measured walk."""


@dataclass(frozen=True)
class FootStrikes:
    """Strikes of both feet in order of time, alternating. N strikes."""

    frames: NDArray[np.int64]  # [N]
    feet: NDArray[np.int64]  # [N] 0 left, 1 right
    length: Array  # [N - 1] metres along the way, ankle to ankle of consecutive strikes
    width: Array  # [N - 1] metres across it; negative if the feet cross
    seconds: Array  # [N - 1] from strike to strike

    @property
    def cadence(self) -> float:
        """Steps per minute."""
        return float(60 / self.seconds.mean())

    @property
    def stride_frames(self) -> int:
        """Frames of a stride, which is two steps."""
        return max(round(2 * float(self.seconds.mean()) * FPS), 2)

    def of(self, foot: int) -> NDArray[np.int64]:
        """Frames of the strikes of one foot."""
        return self.frames[self.feet == foot]


def way(hips: Array) -> tuple[Array, Array]:
    """Unit vectors along a straight way [2] and to its left [2], of hips [T, 3]."""
    along = hips[-1, :2] - hips[0, :2]
    along = along / max(float(np.linalg.norm(along)), 1e-9)
    return along, np.array([-along[1], along[0]])


def steps(ankles: Array, hips: Array) -> FootStrikes | None:
    """Steps of a walk: ankles [T, 2, 3], hips [T, 3]. None when there are less than 4 strikes.

    Where a foot strikes twice in a row, the earlier strike is left out.
    """
    along, left = way(hips)
    ahead = (ankles[..., :2] - hips[:, None, :2]) @ along
    strikes = [
        (int(frame), foot)
        for foot in (0, 1)
        for frame in find_peaks(ahead[:, foot], distance=MIN_STRIDE, prominence=MIN_SWING)[0]
    ]
    kept: list[tuple[int, int]] = []
    for strike in sorted(strikes):
        if kept and kept[-1][1] == strike[1]:
            kept.pop()
        kept.append(strike)
    if len(kept) < MIN_STRIKES:
        return None
    frames, feet = (np.array(column) for column in zip(*kept, strict=True))
    places = ankles[frames, feet, :2]
    step = np.diff(places, axis=0)
    # positive from a right foot to a left one, negative back again
    side = np.where(feet[1:] == 0, 1.0, -1.0)
    return FootStrikes(frames, feet, step @ along, (step @ left) * side, np.diff(frames) / FPS)


def oscillation(values: Array, stride: int) -> float:
    """Range of a sine that swings as much as values [T] do, 2 √2 σ, after their mean over a stride
    (in frames) is subtracted. Changes from stride to stride, a drift or a curve, do not count.
    NaN when there are less than two strides.
    """
    if len(values) < 2 * stride:
        return float("nan")
    mean = np.convolve(values, np.ones(stride) / stride, "valid")
    start = (stride - 1) // 2
    rest = values[start : start + len(mean)] - mean
    return float(2 * np.sqrt(2) * rest[: len(rest) // stride * stride].std())


def extremes(values: Array, strikes: NDArray[np.int64]) -> tuple[float, float]:
    """Mean over strides of the least and of the greatest of values [T]; NaN without a stride."""
    parts = [values[a:b] for a, b in itertools.pairwise(strikes)]
    if not parts:
        return float("nan"), float("nan")
    return float(np.mean([p.min() for p in parts])), float(np.mean([p.max() for p in parts]))


def swing(shoulders: Array, wrists: Array, along: Array) -> Array:
    """Degrees that an arm hangs ahead of the vertical: places [T, 3] of its shoulder and wrist,
    the way [2]. [T]
    """
    arm = wrists - shoulders
    return np.degrees(np.arctan2(arm[:, :2] @ along, -arm[:, 2]))


def phase(strikes: NDArray[np.int64], frames: int) -> Array:
    """Phase 0 … 1 of a cycle that begins with each strike; NaN before the first and after the
    last. [frames]
    """
    found = np.full(max([frames, *strikes.tolist()]), np.nan)
    for a, b in itertools.pairwise(strikes):
        found[a:b] = np.arange(b - a) / (b - a)
    return found[:frames]
