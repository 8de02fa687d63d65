"""Rotations as unit quaternions x, y, z, w. The same algebra holds in left-handed bases."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

IDENTITY: Final = np.array([0.0, 0.0, 0.0, 1.0])


def multiply(p: Array, q: Array) -> Array:
    """The rotation `q`, then `p`: [4], [4] → [4]."""
    (ax, ay, az, aw), (bx, by, bz, bw) = map(float, p), map(float, q)  # far quicker than scalars
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def inverse(q: Array) -> Array:
    """[4] → [4]."""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def rotate(q: Array, v: Array) -> Array:
    """A vector [3] turned by a rotation [4]."""
    (x, y, z, w), (a, b, c) = map(float, q), map(float, v)
    i, j, k = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return np.array(
        [a + w * i + (y * k - z * j), b + w * j + (z * i - x * k), c + w * k + (x * j - y * i)]
    )


def arc(a: Array, b: Array) -> Array:
    """The least rotation that turns the direction of `a` [3] into that of `b` [3]."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    w = 1 + a @ b
    if w < 1e-9:  # opposite: about any axis across
        axis = np.cross(a, np.eye(3)[np.abs(a).argmin()])
        return np.array([*(axis / np.linalg.norm(axis)), 0.0])
    q = np.array([*np.cross(a, b), w])
    return np.asarray(q / np.linalg.norm(q))


def from_axes(columns: Array) -> Array:
    """The rotation of a matrix [3, 3] of determinant 1, by Shepperd's method."""
    m = columns
    choices = [m[0, 0], m[1, 1], m[2, 2], np.trace(m)]
    k = int(np.argmax(choices))
    if k == 3:
        q = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1 + choices[3]])
    else:
        i, j, n = k, (k + 1) % 3, (k + 2) % 3
        q = np.empty(4)
        q[i] = 1 + m[i, i] - m[j, j] - m[n, n]
        q[j], q[n] = m[j, i] + m[i, j], m[n, i] + m[i, n]
        q[3] = m[n, j] - m[j, n]
    return np.asarray(q / np.linalg.norm(q))


def slerp(a: Array, b: Array, share: float | Array) -> Array:
    """Interpolates unit quaternions [..., 4] along the shorter arc; `share`: one, or [..., 1]."""
    cosine = (a * b).sum(-1, keepdims=True)
    b = np.where(cosine < 0, -b, b)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-4  # straight line and circle are the same here
    divisor = np.where(near, 1.0, sine)
    from_a = np.where(near, 1 - share, np.sin((1 - share) * angle) / divisor)
    from_b = np.where(near, share, np.sin(share * angle) / divisor)
    mixed = from_a * a + from_b * b
    return np.asarray(mixed / np.linalg.norm(mixed, axis=-1, keepdims=True), np.float32)
