"""What arms do: bend of elbows, upper arms away from the body, swing of wrists, lifted arms.

World space, metres, Z up, 40 fps. T frames; left comes before right.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

OUT: Final = 60.0
"""Degrees from the body beyond which an upper arm is lifted."""


def _units(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)


def elbow_bend(shoulders: Array, elbows: Array, wrists: Array) -> Array:
    """Degrees between upper arm and forearm, 0: straight. Places [T, 2, 3] → [T, 2]"""
    cosine = (_units(elbows - shoulders) * _units(wrists - elbows)).sum(-1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def outward(shoulders: Array, elbows: Array, chest: Array) -> Array:
    """Degrees of each upper arm away from the body: the arc sine of its outward part in the
    chest's frame. 0: hanging, wherever it swings. 90: held out. Negative: across the body.

    Places [T, 2, 3]; chest [T, 3, 3], world rotations with columns right, forward, up. [T, 2]
    """
    arm = _units(elbows - shoulders)
    to_the_right = np.einsum("tfi,ti->tf", arm, chest[:, :, 0])
    aside = to_the_right * np.array([-1.0, 1.0])
    return np.degrees(np.arcsin(np.clip(aside, -1, 1)))


def ahead_of(points: Array, middle: Array, facing: Array) -> Array:
    """Metres that points [T, P, 3] are ahead of a middle [T, 3], the way faced [T, 2]. [T, P]"""
    found: Array = np.einsum("tpi,ti->tp", (points - middle[:, None])[..., :2], facing)
    return found


def swing_range(ahead: Array) -> float:
    """Metres between the 5th and 95th percentile of each column [T, P], mean over them."""
    low, high = np.quantile(ahead, (0.05, 0.95), axis=0)
    return float((high - low).mean())


def against_legs(wrists: Array, ankles: Array) -> float:
    """How far each arm swings with the leg of the other side: the correlation of how far ahead a
    wrist and the opposite ankle are [T, 2] both, mean of the two. NaN for limbs that do not move.
    """
    if min(wrists.std(0).min(), ankles.std(0).min()) < 1e-4:
        return float("nan")
    pairs = ((wrists[:, 0], ankles[:, 1]), (wrists[:, 1], ankles[:, 0]))
    return float(np.mean([np.corrcoef(*pair)[0, 1] for pair in pairs]))


def lifted(shoulders: Array, wrists: Array, away: Array) -> NDArray[np.bool_]:
    """Frames with an arm up: a wrist over its shoulder [T, 2, 3], or an upper arm more than 60°
    away from the body [T, 2]. [T]
    """
    up = (wrists[..., 2] > shoulders[..., 2]) | (away > OUT)
    return np.asarray(up.any(-1))
