"""Conversions between rotation representations, as numpy arrays: the twin of the lab's
`training/rotation.py`.

Matrices act on column vectors. Quaternions are x, y, z, w. A rotation vector is axis times angle in
radians. The core basis is Z up, facing +Y, right side +X; the glTF basis is Y up, facing +Z.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

GLTF_FROM_CORE: Array = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
"""p_gltf = GLTF_FROM_CORE @ p_core = (-x, z, y). A proper rotation and its own inverse."""


def gltf_quaternion(quaternion: Array) -> Array:
    """The same turn seen in the glTF basis (or back: the map is its own inverse). [..., 4]."""
    x, y, z, w = np.moveaxis(np.asarray(quaternion), -1, 0)
    return np.stack([-x, z, y, w], -1)


def matrix_from_quaternion(quaternion: Array) -> Array:
    """[..., 4] (normalised here) → [..., 3, 3]."""
    unit = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    x, y, z, w = np.moveaxis(unit, -1, 0)
    rows = [
        np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
        np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
        np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1),
    ]
    return np.stack(rows, -2)


def quaternion_from_matrix(matrix: Array) -> Array:
    """[..., 3, 3] → [..., 4] with w ≥ 0, read off by the largest of four pivots (stable)."""
    m = np.asarray(matrix)
    trace = np.trace(m, axis1=-2, axis2=-1)[..., None]
    outer = m + np.swapaxes(m, -1, -2)
    skew = np.stack(
        [m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], -1
    )
    # row i of `table` is 4·q_i·(x, y, z, w); the row with the largest pivot 4·q_i² is the best
    diagonal = np.diagonal(m, axis1=-2, axis2=-1)
    table = np.empty((*m.shape[:-2], 4, 4))
    table[..., :3, :3] = outer
    table[..., range(3), range(3)] = 1 + 2 * diagonal - trace
    table[..., :3, 3] = table[..., 3, :3] = skew
    table[..., 3, 3] = 1 + trace[..., 0]
    pivots = np.diagonal(table, axis1=-2, axis2=-1)
    best = np.argmax(pivots, -1)[..., None, None]
    row = np.take_along_axis(table, best, -2)[..., 0, :]
    unit = row / np.linalg.norm(row, axis=-1, keepdims=True)
    return np.where(unit[..., 3:] < 0, -unit, unit)


def quaternion_from_rotvec(rotvec: Array) -> Array:
    """[..., 3] → [..., 4]. Safe at zero."""
    angle = np.linalg.norm(rotvec, axis=-1, keepdims=True)
    # sin(a/2)/a = sinc(a/2π)/2, which is smooth at zero
    return np.concatenate([rotvec * np.sinc(angle / (2 * np.pi)) / 2, np.cos(angle / 2)], -1)


def rotvec_from_quaternion(quaternion: Array) -> Array:
    """[..., 4] → [..., 3] with angle in [0, π]. Safe at zero."""
    q = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    q = np.where(q[..., 3:] < 0, -q, q)
    half_sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(half_sine, q[..., 3:])
    # angle / sin(angle/2) tends to 2
    return q[..., :3] * np.where(half_sine > 1e-9, angle / np.maximum(half_sine, 1e-9), 2.0)


def inverse(q: Array) -> Array:
    """The inverse of unit quaternions. [..., 4]"""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def multiply(p: Array, q: Array) -> Array:
    """The rotation q, then p. [..., 4]"""
    a, b, c, d = np.moveaxis(p, -1, 0)
    x, y, z, w = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            d * x + a * w + b * z - c * y,
            d * y - a * z + b * w + c * x,
            d * z + a * y - b * x + c * w,
            d * w - a * x - b * y - c * z,
        ],
        -1,
    )


def continuous_quaternions(quaternions: Array) -> Array:
    """Flips signs so that neighbours in time (axis 0) lie on one half-sphere. [N, ..., 4]."""
    q = np.array(quaternions)
    flips = np.sum(q[1:] * q[:-1], axis=-1, keepdims=True) < 0
    q[1:] *= np.where(np.cumsum(flips, axis=0) % 2 == 1, -1.0, 1.0)
    return q
