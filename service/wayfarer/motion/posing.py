"""Algebra of many poses at once, *poses last*: every array ends in [..., F, A], frames and agents.

A rotation is [3, 3, ..., F, A]: rows, columns. Each number of a rotation is then one long row over
all poses, and sums run over leading axes: a step needs tens of thousands of 3 × 3 products, which
CPUs and exporters handle badly as matrices. Differentiable, exportable.
"""

import torch
from torch import Tensor

from wayfarer.motion.constants import indices

SMALLEST = 1e-6
"""Lengths below this count as this."""


def to_columns(rows: Tensor) -> Tensor:
    """[A, ...] → [..., A]. One axis at a time: to an engine, that is the transpose of a matrix,
    ten times as fast as a permutation of all axes.
    """
    return rows.flatten(1).T.unflatten(0, rows.shape[1:])


def to_rows(columns: Tensor) -> Tensor:
    """[..., A] → [A, ...], in the same way."""
    return columns.flatten(0, -2).T.unflatten(1, columns.shape[:-1])


def unit(v: Tensor) -> Tensor:
    """Vectors [3, ...] or quaternions [4, ...] of length 1."""
    # the square is bounded: a root has no slope at zero
    return v / torch.sqrt(dot(v, v).clamp(min=SMALLEST * SMALLEST))


def dot(a: Tensor, b: Tensor) -> Tensor:
    """[N, ...] · [N, ...] → [1, ...]"""
    products = a * b
    total = products[:1]
    for i in range(1, len(products)):
        total = total + products[i : i + 1]
    return total


def cross(a: Tensor, b: Tensor) -> Tensor:
    """[3, ...] × [3, ...]"""
    turned = indices((1, 2, 0), a), indices((2, 0, 1), a)
    return a[turned[0]] * b[turned[1]] - a[turned[1]] * b[turned[0]]


def compose(a: Tensor, b: Tensor) -> Tensor:
    """Matrix products [3, 3, ...] · [3, 3, ...] (or [3, n, ...])."""
    return a[:, :1] * b[None, 0] + a[:, 1:2] * b[None, 1] + a[:, 2:] * b[None, 2]


def turn(rotation: Tensor, v: Tensor) -> Tensor:
    """[3, 3, ...] · vectors [3, ...]"""
    return rotation[:, 0] * v[0] + rotation[:, 1] * v[1] + rotation[:, 2] * v[2]


def from_6d(sixd: Tensor) -> Tensor:
    """Orthonormalises two columns (Gram-Schmidt): [6, ...] → [3, 3, ...]."""
    x = unit(sixd[:3])
    second = sixd[3:]
    y = unit(second - dot(x, second) * x)
    return torch.stack([x, y, cross(x, y)], 1)


def to_6d(rotation: Tensor) -> Tensor:
    """First two columns: [3, 3, ...] → [6, ...]."""
    return torch.cat([rotation[:, 0], rotation[:, 1]])


def from_quaternion(quaternion: Tensor) -> Tensor:
    """x, y, z, w [4, ...], normalised here → [3, 3, ...]."""
    x, y, z, w = unit(quaternion)
    rows = [
        torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)]),
        torch.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)]),
        torch.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]),
    ]
    return torch.stack(rows)


def to_quaternion(rotation: Tensor) -> Tensor:
    """[3, 3, ...] → x, y, z, w [4, ...], w ≥ 0.

    A matrix gives the quaternion in four ways. The one with the largest pivot is
    stable; comparisons find it, so no branch depends on the data.
    """
    (m00, m01, m02), (m10, m11, m12), (m20, m21, m22) = rotation
    ways = [
        torch.stack([1 + m00 - m11 - m22, m01 + m10, m02 + m20, m21 - m12]),
        torch.stack([m01 + m10, 1 - m00 + m11 - m22, m12 + m21, m02 - m20]),
        torch.stack([m02 + m20, m12 + m21, 1 - m00 - m11 + m22, m10 - m01]),
        torch.stack([m21 - m12, m02 - m20, m10 - m01, 1 + m00 + m11 + m22]),
    ]
    best, pivot = ways[3], ways[3][3:]
    for i in range(3):
        better = ways[i][i : i + 1] > pivot
        best = torch.where(better, ways[i], best)
        pivot = torch.where(better, ways[i][i : i + 1], pivot)
    best = unit(best)
    return torch.where(best[3:] < 0, -best, best)
