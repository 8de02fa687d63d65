"""How deep bodies are in each other: capsule by capsule."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]


def overlaps(
    frame: Index, hips: Array, start: Array, end: Array, radius: Array
) -> tuple[Index, Index, Array]:
    """Pairs of bodies that overlap in the same frame, and how deep.

    R bodies, each in one frame: frame [R], hips [R, 3], capsules start, end [R, C, 3] and radius
    [R, C]. Returns rows [P], rows [P] and metres [P], above 0.
    """
    nobody = np.empty(0, np.int64)
    if len(frame) < 2:
        return nobody, nobody, np.empty(0)
    reach = _reach(hips, start, end, radius)
    widest = 2 * float(reach.max())
    # frames lie so far apart that only bodies of the same one are near each other
    spots = np.column_stack([hips[:, :2], (frame - frame.min()) * (widest + 1.0)])
    one, other = cKDTree(spots).query_pairs(widest, output_type="ndarray").T
    near = np.linalg.norm(hips[one, :2] - hips[other, :2], axis=-1) < reach[one] + reach[other]
    one, other = one[near].astype(np.int64), other[near].astype(np.int64)
    if not len(one):
        return nobody, nobody, np.empty(0)
    # every capsule of one with every capsule of the other
    a, b = (x[one][:, :, None] for x in (start, end))
    c, d = (x[other][:, None] for x in (start, end))
    depth = radius[one][:, :, None] + radius[other][:, None] - segment_distance(a, b, c, d)
    deepest = depth.max((1, 2))
    return one[deepest > 0], other[deepest > 0], deepest[deepest > 0]


def _reach(hips: Array, start: Array, end: Array, radius: Array) -> Array:
    """Horizontal metres from the hips within which all of a body is. [R]"""
    ends = np.stack([start, end], 2)[..., :2] - hips[:, None, None, :2]
    out = np.linalg.norm(ends, axis=-1).max(-1) + radius
    reach: Array = out.max(-1)
    return reach


def segment_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Least distance between the segments a–b and c–d. [..., 3] each, broadcast. [...]

    Nearest points by clamping (Ericson, Real-Time Collision Detection, 5.1.9).
    """
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = (u * u).sum(-1), (v * v).sum(-1), (u * v).sum(-1)
    uw, vw = (u * w).sum(-1), (v * w).sum(-1)
    uu, vv = np.maximum(uu, 1e-12), np.maximum(vv, 1e-12)
    between = uu * vv - uv * uv
    s = np.clip((uv * vw - uw * vv) / np.maximum(between, 1e-12), 0, 1)
    t = np.clip((uv * s + vw) / vv, 0, 1)
    s = np.clip((uv * t - uw) / uu, 0, 1)
    gap = w + s[..., None] * u - t[..., None] * v
    return np.linalg.norm(gap, axis=-1)
