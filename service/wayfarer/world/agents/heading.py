"""Headings: angles in radians about +Z (0 faces +Y), or the horizontal unit vectors faced."""

from math import cos, sin

import numpy as np

from wayfarer.world.output.quaternion import bounded
from wayfarer.world.rows import Array, Float


def facing_of(hips: Float) -> Float:
    """Horizontal unit vectors [..., 2] that bodies face, from their hips' rotations [..., 4].

    They are at right angles to the body's right side, so that leaning does not change them.
    """
    x, y, z, w = (hips[..., k] for k in range(4))
    aside, ahead = -2 * (x * y + z * w), 1 - 2 * (y * y + z * z)
    length = np.maximum(np.sqrt(aside * aside + ahead * ahead), 1e-9)
    facing = np.empty((*aside.shape, 2), np.float32)
    facing[..., 0], facing[..., 1] = aside / length, ahead / length
    return facing


def heading_of(hips: Float) -> float:
    """Heading of a body from its hips' rotation [4]."""
    x, y = facing_of(hips)
    return float(np.arctan2(-x, y))


def facing_at(heading: float) -> tuple[float, float]:
    """The direction that a body faces at a heading."""
    return -sin(heading), cos(heading)


def angle_between(a: Array, b: Array) -> Float:
    """Radians [...], 0 … π, between unit vectors [..., 2]."""
    return np.asarray(
        np.arccos(bounded(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1], -1, 1)), np.float32
    )
