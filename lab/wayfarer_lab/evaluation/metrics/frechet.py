"""Fréchet distance between motions on a fixed, hand-made feature of 2 s of movement.

`frechet_v1`, 37 numbers of a window of 80 frames at 40 fps. Six sites are means of markers:
hips (LFWT RFWT LBWT RBWT), head (LFHD RFHD LBHD RBHD), hands (IWR OWR) and feet (ANK HEE MT1 MT5).
Velocities (`kinematics.velocity`) are turned, frame by frame, into the body's heading: right,
forward, up; forward is the horizontal direction square to the line from left to right waist.

    hips      mean right and forward velocity; standard deviation of all three; mean and standard
              deviation of height; mean and standard deviation of the turning speed (rad/s)    9
    others    mean and standard deviation of height; standard deviation of the three
              velocities relative to the hips                                              5 × 5
    together  covariance c of two forward velocities relative to the hips, with standard
              deviations a and b, as c / (a b + 0.01 m²/s²): left with right foot, left foot with
              left hand, right foot with right hand                                            3

Windows begin every 8 frames. Each number is divided by its standard deviation in the reference
(the recorded locomotion of a data set's train split); the distance is that of the two Gaussians,
|μ₁ - μ₂|² + Tr(Σ₁ + Σ₂ - 2 (Σ₁ Σ₂)^½), 0 for like motion. With few windows it is too large: hold it
against the row "mocap", other people's recordings measured against the same reference.
Any change of the feature needs a new name.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer_lab.evaluation.metrics.kinematics import velocity

Array = NDArray[np.floating[Any]]

NAME: Final = "frechet_v1"
FRAMES: Final = 2 * FPS
HOP: Final = NEW_FRAMES
SIZE: Final = 37
MIN_WINDOWS: Final = 2 * SIZE
"""Minimum windows for a useful covariance, and so for a distance."""

WAIST: Final = ("LFWT", "LBWT", "RFWT", "RBWT")
SITES: Final = {
    "head": ("LFHD", "RFHD", "LBHD", "RBHD"),
    "left hand": ("LIWR", "LOWR"),
    "right hand": ("RIWR", "ROWR"),
    "left foot": ("LANK", "LHEE", "LMT1", "LMT5"),
    "right foot": ("RANK", "RHEE", "RMT1", "RMT5"),
}
PAIRS: Final = (
    ("left foot", "right foot"),
    ("left foot", "left hand"),
    ("right foot", "right hand"),
)
NAMES: Final = (
    "hips right speed", "hips forward speed", "hips right speed sd", "hips forward speed sd",
    "hips up speed sd", "hips height", "hips height sd", "turning", "turning sd",
    *(
        f"{site} {figure}"
        for site in SITES
        for figure in ("height", "height sd", "right speed sd", "forward speed sd", "up speed sd")
    ),
    *(f"{a} with {b}" for a, b in PAIRS),
)  # fmt: skip
"""Names of the numbers, in order."""

STILL: Final = 0.01
"""m²/s²: keeps the correlation of parts that hardly move near 0."""


def features(markers: Array, names: Sequence[str]) -> Array:
    """Features [W, 37] of all windows of a track: markers [T, M, 3] called `names`, any T."""
    if len(markers) < FRAMES:
        return np.zeros((0, SIZE))
    row = {name: index for index, name in enumerate(names)}

    def centre(group: Sequence[str]) -> Array:
        return markers[:, [row[name] for name in group]].mean(1, dtype=np.float64)

    right = (centre(WAIST[2:]) - centre(WAIST[:2]))[:, :2]
    right /= np.linalg.norm(right, axis=-1, keepdims=True) + 1e-9
    yaw = np.unwrap(np.arctan2(right[:, 1], right[:, 0]))

    def turned(points: Array) -> Array:
        """Velocity to the right, forward and up [T, 3] of a site [T, 3]."""
        v = velocity(points[:, None])[:, 0]
        across = v[:, 0] * right[:, 0] + v[:, 1] * right[:, 1]
        along = v[:, 1] * right[:, 0] - v[:, 0] * right[:, 1]
        return np.stack([across, along, v[:, 2]], -1)

    hips = centre(WAIST)
    travel, turning = _cut(turned(hips)), _cut(np.gradient(yaw, 1 / FPS)[:, None])
    parts = [travel.mean(1)[:, :2], travel.std(1), *_mean_and_std(hips[:, 2:])]
    parts += [turning.mean(1), turning.std(1)]
    relative = {}
    for name, group in SITES.items():
        place = centre(group)
        relative[name] = _cut(turned(place)) - travel
        parts += [*_mean_and_std(place[:, 2:]), relative[name].std(1)]
    parts += [_together(relative[a][..., 1], relative[b][..., 1]) for a, b in PAIRS]
    return np.concatenate(parts, -1)


@dataclass(frozen=True)
class Reference:
    """Reference motion: its features [W, 37]."""

    values: Array

    @classmethod
    def of(cls, tracks: Iterable[Array], names: Sequence[str]) -> "Reference":
        """Measures tracks of markers [T, M, 3]."""
        return cls(np.concatenate([np.zeros((0, SIZE)), *(features(t, names) for t in tracks)]))

    def distance(self, values: Array) -> float:
        """Fréchet distance of features [W, 37]; NaN when there are too few windows of either."""
        if min(len(values), len(self.values)) < MIN_WINDOWS:
            return float("nan")
        scale = self.values.std(0) + 1e-6
        return frechet(values / scale, self.values / scale)


def frechet(a: Array, b: Array) -> float:
    """Fréchet distance of the Gaussians fitted to samples a [N, D] and b [M, D]."""
    mean = a.mean(0) - b.mean(0)
    first, second = np.cov(a, rowvar=False), np.cov(b, rowvar=False)
    root = _root(first)
    # Tr (Σ₁ Σ₂)^½ = Tr (Σ₁^½ Σ₂ Σ₁^½)^½, which is symmetric
    common = np.sqrt(np.linalg.eigvalsh(root @ second @ root).clip(min=0)).sum()
    return float(mean @ mean + np.trace(first) + np.trace(second) - 2 * common)


def _root(matrix: Array) -> Array:
    """Square root of a symmetric positive matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.sqrt(values.clip(min=0))) @ vectors.T


def _cut(track: Array) -> Array:
    """Windows [W, 80, C] of [T, C], one every 8 frames."""
    views = np.lib.stride_tricks.sliding_window_view(track, FRAMES, axis=0)
    return np.moveaxis(views[::HOP], -1, 1)


def _mean_and_std(values: Array) -> tuple[Array, Array]:
    windows = _cut(values)
    return windows.mean(1), windows.std(1)


def _together(a: Array, b: Array) -> Array:
    """Near-correlation [W, 1] of two signals [W, 80]."""
    a, b = a - a.mean(1, keepdims=True), b - b.mean(1, keepdims=True)
    return ((a * b).mean(1) / (a.std(1) * b.std(1) + STILL))[:, None]
