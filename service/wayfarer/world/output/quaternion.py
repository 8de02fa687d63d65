"""Vectors and unit quaternions (x, y, z, w) with the components as the first axis.

Shapes are [3, ...] and [4, ...] and broadcast: so sums and products run along agents and frames,
which is several times faster than numpy's cross products and 3×3 matrices over a short last axis.
"""

import numpy as np

from wayfarer.world.rows import Array


def stacked(*components: Array) -> Array:
    """Components of one shape as one array: `np.stack` without inspecting each of them."""
    first = components[0]
    made = np.empty((len(components), *first.shape), first.dtype)
    for place, component in enumerate(components):
        made[place] = component
    return made


def bounded(values: Array, low: float, high: float) -> Array:
    """Like `np.clip`, which takes several times as long for arrays of this size."""
    found: Array = np.minimum(np.maximum(values, low), high)
    return found


def multiply(a: Array, b: Array) -> Array:
    """The rotation by b, then by a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return stacked(
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by + ay * bw + az * bx - ax * bz,
        aw * bz + az * bw + ax * by - ay * bx,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def inverse(q: Array) -> Array:
    """The inverse rotation."""
    return stacked(-q[0], -q[1], -q[2], q[3])


def rotate_points(q: Array, points: Array) -> Array:
    """Several points [3, P, ...] rotated by each q [4, ...], by its matrix, which is cheaper."""
    x, y, z, w = q
    x2, y2, z2 = 2 * x, 2 * y, 2 * z
    xx, yy, zz, wx, wy, wz = x * x2, y * y2, z * z2, w * x2, w * y2, w * z2
    xy, xz, yz = x * y2, x * z2, y * z2
    a, b, c = points
    return stacked(
        (1 - yy - zz) * a + (xy - wz) * b + (xz + wy) * c,
        (xy + wz) * a + (1 - xx - zz) * b + (yz - wx) * c,
        (xz - wy) * a + (yz + wx) * b + (1 - xx - yy) * c,
    )


def length(v: Array) -> Array:
    """Euclidean norm, without the first axis."""
    norm: Array = np.sqrt(sum((c * c for c in v[1:]), v[0] * v[0]))
    return norm


def unit(v: Array) -> Array:
    """The same direction at length 1; zero stays zero."""
    return v / np.maximum(length(v), 1e-12)
