"""Plain upper bodies on the legs of people who act.

Legs and hips of a styled take (an aeroplane, a chicken) are good motion; arms and trunk are not
what people do. From plain takes a linear map is learned that gives the upper body's local rotations
from what hips and legs do at that moment; acted takes get their upper body from it. Arms swing
against the legs, as far as those swing, and hang when they do not.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import numpy as np
from scipy.spatial.transform import Rotation

from wayfarer.errors import DataError
from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.fit import FittedClip
from wayfarer_lab.training.mocap.rig import JOINT_NAMES, J
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.skeleton import Array

UPPER = tuple(
    i
    for i, name in enumerate(JOINT_NAMES)
    if name.partition("_")[2] in ("collar", "shoulder", "elbow", "wrist")
    or name.startswith(("spine", "neck", "head"))
)
PLAIN = "plain"
"""The tag of clips whose upper body was replaced."""

RIDGE = 1e-2
"""Ridge of the regression, in units of the features' variance."""

FASTEST = 2.2
"""m/s: a faster person runs, and holds the arms as runners do."""


@dataclass(frozen=True)
class UpperBody:
    """The map, as learned from plain takes."""

    rest: Array  # [U, 4] mean rotation of each joint of `UPPER`
    mean: Array  # [K] of the features
    scale: Array  # [K]
    low: Array  # [K] the range of the features in which the map was learned
    high: Array  # [K]
    weights: Array  # [K + 1, 3 U]: rotation vectors from the mean

    def of(self, translation: Array, rotations: Array) -> Array:
        """Rotations [N, U, 4] of the upper body of legs and hips as in `FittedClip`."""
        features = (leg_features(translation, rotations) - self.mean) / self.scale
        features = features.clip(self.low, self.high)
        turns = np.concatenate([features, np.ones((len(features), 1))], 1) @ self.weights
        mean = Rotation.from_quat(np.tile(self.rest, (len(features), 1)))
        turned = mean * Rotation.from_rotvec(turns.reshape(-1, 3))
        return turned.as_quat().reshape(len(features), len(UPPER), 4)


def leg_features(translation: Array, rotations: Array) -> Array:
    """What hips and legs do in each frame [N, K]: thighs, knees, lean, velocity, turning."""
    rotations = rotations.astype(np.float64)
    root = Rotation.from_quat(rotations[:, 0]).as_matrix()
    heading = np.unwrap(np.arctan2(-root[:, 0, 1], root[:, 1, 1]))
    down = np.array([0.0, 0.0, -1.0])
    thighs, knees = [], []
    for side in ("left", "right"):
        thighs.append(Rotation.from_quat(rotations[:, J[f"{side}_hip"]]).apply(down)[:, :2])
        knees.append(Rotation.from_quat(rotations[:, J[f"{side}_knee"]]).as_rotvec()[:, :1])
    swing = np.concatenate(thighs, 1)
    forward = np.stack([-np.sin(heading), np.cos(heading)], -1)
    velocity = np.gradient(_smooth(translation[:, :2].astype(np.float64)), axis=0) * FPS
    ahead = (velocity * forward).sum(-1)
    across = velocity[:, 0] * forward[:, 1] - velocity[:, 1] * forward[:, 0]
    lean = np.stack([root[:, 2, 1], root[:, 2, 0]], -1)  # of hips' forward and right axes
    rate = np.gradient(_smooth(heading[:, None])[:, 0]) * FPS
    return np.concatenate(
        [
            swing,
            np.gradient(swing, axis=0) * FPS,
            *knees,
            lean,
            np.stack([np.abs(ahead), np.abs(across), rate], -1),
        ],
        1,
    )


def learn_upper(plain: Sequence[FittedClip]) -> UpperBody:
    """The map from plain takes. Raises DataError when they hold no second of upright motion."""
    features, turns = [], []
    for clip in plain:
        if len(clip) < 3:
            continue
        found = leg_features(clip.translation, clip.rotations)
        speed = np.linalg.norm(found[:, -3:-1], axis=-1)
        kept = (clip.use != Use.EXCLUDED) & (speed < FASTEST)
        features.append(found[kept])
        turns.append(clip.rotations[kept][:, list(UPPER)].astype(np.float64))
    if sum(map(len, features)) < FPS:
        raise DataError("no plain take to learn upper bodies from")
    x, y = np.concatenate(features), np.concatenate(turns)
    rest = np.stack([_mean(y[:, u]) for u in range(len(UPPER))])
    back = Rotation.from_quat(np.tile(rest, (len(y), 1))).inv()
    vectors = (back * Rotation.from_quat(y.reshape(-1, 4))).as_rotvec().reshape(len(y), -1)
    mean, scale = x.mean(0), x.std(0) + 1e-6
    x = (x - mean) / scale
    design = np.concatenate([x, np.ones((len(x), 1))], 1)
    ridge = RIDGE * len(x) * np.diag([*np.ones(x.shape[1]), 0.0])
    weights = np.linalg.solve(design.T @ design + ridge, design.T @ vectors)
    low, high = np.quantile(x, [0.01, 0.99], axis=0)
    return UpperBody(rest, mean, scale, low, high, weights)


def plain_uppers(fits: Sequence[FittedClip], acted: Sequence[str]) -> list[FittedClip]:
    """`fits`, where train clips whose source matches a pattern of `acted` get plain upper bodies.

    The map is learned from all other train clips of locomotion.
    """
    if not acted:
        return list(fits)
    own = [any(fnmatchcase(f.info.source, pattern) for pattern in acted) for f in fits]
    train = [f.info.split == "train" for f in fits]
    upper = learn_upper(
        [
            f
            for f, a, t in zip(fits, own, train, strict=True)
            if t and not a and f.info.locomotion and f.shape.kind == "own"
        ]
    )
    return [
        with_upper(f, upper) if a and t else f for f, a, t in zip(fits, own, train, strict=True)
    ]


def with_upper(clip: FittedClip, upper: UpperBody) -> FittedClip:
    """The clip with another upper body."""
    rotations = clip.rotations.copy()
    rotations[:, list(UPPER)] = upper.of(clip.translation, clip.rotations)
    info = replace(clip.info, augmentation=PLAIN)
    return replace(clip, rotations=rotations.astype(np.float32), info=info)


def _mean(quaternions: Array) -> Array:
    mean: Array = Rotation.from_quat(quaternions).mean().as_quat()
    return mean


def _smooth(values: Array, frames: int = 9) -> Array:
    """Moving average over time, edges held."""
    half = min(frames // 2, len(values) - 1)
    padded = np.concatenate([values[:1]] * half + [values] + [values[-1:]] * half)
    sums = np.cumsum(np.concatenate([np.zeros_like(padded[:1]), padded]), axis=0)
    width = 2 * half + 1
    return (sums[width:] - sums[:-width]) / width
