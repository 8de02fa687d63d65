"""Headings: an angle in radians about +Z, 0 faces +Y; or the horizontal unit vector it faces."""

from math import cos, sin

import numpy as np

from wayfarer.world.rows import Float


def facing_of(hips: Float) -> Float:
    """Horizontal unit vector [..., 2] that bodies face whose hips are turned so [..., 4].

    It is at right angles to the body's right side, so that leaning does not change it.
    """
    x, y, z, w = np.moveaxis(hips, -1, 0)
    facing = np.stack([-2 * (x * y + z * w), 1 - 2 * (y * y + z * z)], -1)
    length = np.linalg.norm(facing, axis=-1, keepdims=True)
    return np.asarray(facing / np.maximum(length, 1e-9), np.float32)


def heading_of(hips: Float) -> float:
    """Heading of a body whose hips are turned so [4]."""
    x, y = facing_of(hips)
    return float(np.arctan2(-x, y))


def facing_at(heading: float) -> tuple[float, float]:
    """What a body faces at a heading."""
    return -sin(heading), cos(heading)


def angle_between(a: Float, b: Float) -> Float:
    """Radians [...], 0 … π, between unit vectors [..., 2]."""
    return np.asarray(np.arccos(np.clip((a * b).sum(-1), -1, 1)), np.float32)
