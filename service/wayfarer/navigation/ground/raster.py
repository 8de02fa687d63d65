"""Triangles → the cells they cover or touch, with heights: vectorised scan conversion."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.grid import Grid, expand

Array = NDArray[np.floating[Any]]
Ints = NDArray[np.int64]

MAX_SAMPLES: Final = 8_000_000
"""Maximum number of cells touched by all triangles: limits memory and time of a bake."""


@dataclass(frozen=True, slots=True)
class Spans:
    """Cells (flat index), the heights between which each is filled, and the triangle that fills it.
    Each [n].
    """

    cell: Ints
    low: Array
    high: Array
    triangle: Ints


def covered(corners: Array, grid: Grid) -> Spans:
    """Cells whose middle lies under a triangle; low = high = its height there."""
    if len(corners) == 0:
        return _nothing()
    a = _in_cells(corners, grid) - [0.5, 0.5, 0.0]  # the middle of a cell is at whole numbers
    first, last = _range(np.ceil(a[..., 1].min(1)), np.floor(a[..., 1].max(1)), grid.rows)
    tri, row = _bounded_expand(first, last)
    low, high = np.full(len(tri), np.inf), np.full(len(tri), -np.inf)
    for k in range(3):
        p, q = a[tri, k], a[tri, (k + 1) % 3]
        # from its lower end, so that both triangles of an edge find the same place on it
        turned = (p[:, 1] > q[:, 1])[:, None]
        p, q = np.where(turned, q, p), np.where(turned, p, q)
        crosses = (p[:, 1] <= row) != (q[:, 1] <= row)
        x = p[:, 0] + _ratio(row - p[:, 1], q[:, 1] - p[:, 1]) * (q[:, 0] - p[:, 0])
        low = np.where(crosses, np.minimum(low, x), low)
        high = np.where(crosses, np.maximum(high, x), high)
    start, stop = _range(np.ceil(low), np.ceil(high) - 1, grid.columns)
    run, column = _bounded_expand(start, stop)
    tri, row = tri[run], row[run]
    normal, anchor = _planes(a)
    z = anchor[tri, 2] - _ratio(
        normal[tri, 0] * (column - anchor[tri, 0]) + normal[tri, 1] * (row - anchor[tri, 1]),
        normal[tri, 2],
    )
    return Spans(row * grid.columns + column, z, z, tri)


def touched(corners: Array, grid: Grid) -> Spans:
    """Cells that a triangle passes through, even edge on, and its lowest and highest point there.

    A triangle is cut into the rows' bands; within a band, heights follow its plane.
    """
    if len(corners) == 0:
        return _nothing()
    a = _in_cells(corners, grid)
    first, last = _range(np.floor(a[..., 1].min(1)), np.floor(a[..., 1].max(1)), grid.rows)
    tri, row = _bounded_expand(first, last)
    left, right, bottom, top = (np.full(len(tri), s * np.inf) for s in (1, -1, 1, -1))
    for k in range(3):
        p, q = a[tri, k], a[tri, (k + 1) % 3]
        span = q[:, 1] - p[:, 1]
        meets = (np.minimum(p[:, 1], q[:, 1]) <= row + 1) & (np.maximum(p[:, 1], q[:, 1]) >= row)
        level = np.abs(span) < 1e-9
        for edge, flat in ((row, 0.0), (row + 1, 1.0)):
            share = np.where(level, flat, np.clip(_ratio(edge - p[:, 1], span), 0, 1))
            x = p[:, 0] + share * (q[:, 0] - p[:, 0])
            z = p[:, 2] + share * (q[:, 2] - p[:, 2])
            np.minimum(left, x, out=left, where=meets)
            np.maximum(right, x, out=right, where=meets)
            np.minimum(bottom, z, out=bottom, where=meets)
            np.maximum(top, z, out=top, where=meets)
    start, stop = _range(np.floor(left), np.floor(right), grid.columns)
    run, column = _bounded_expand(start, stop)
    tri, row, bottom, top = tri[run], row[run], bottom[run], top[run]
    normal, anchor = _planes(a)
    slope = _ratio(-normal[tri, :2].T, normal[tri, 2])  # height per cell, along x and y
    z = anchor[tri, 2] + (slope * (np.stack([column, row]) + 0.5 - anchor[tri, :2].T)).sum(0)
    reach = np.abs(slope).sum(0) / 2
    steep = np.abs(normal[tri, 2]) < 1e-6 * np.linalg.norm(normal[tri], axis=1)
    low = np.where(steep, bottom, np.clip(z - reach, bottom, top))
    high = np.where(steep, top, np.clip(z + reach, bottom, top))
    return Spans(row * grid.columns + column, low, high, tri)


def _in_cells(corners: Array, grid: Grid) -> Array:
    """Corners [T, 3, 3] with x and y in cells (whole numbers at the cells' edges), z in metres."""
    flat = (corners[..., :2] - grid.origin) / grid.cell
    return np.concatenate([flat, corners[..., 2:]], -1)


def _planes(a: Array) -> tuple[Array, Array]:
    """Normals [T, 3] and a point of each plane [T, 3]."""
    return np.cross(a[:, 1] - a[:, 0], a[:, 2] - a[:, 0]), a[:, 0]


def _range(first: Array, last: Array, end: int) -> tuple[Ints, Ints]:
    """Whole numbers first … last, cut to 0 … end - 1, as [start, stop)."""
    start = np.clip(np.nan_to_num(first, posinf=end, neginf=0), 0, end).astype(np.int64)
    stop = np.clip(np.nan_to_num(last, posinf=end, neginf=-1) + 1, 0, end).astype(np.int64)
    return start, stop


def _bounded_expand(first: Ints, last: Ints) -> tuple[Ints, Ints]:
    total = int(np.maximum(last - first, 0).sum())
    if total > MAX_SAMPLES:
        raise InvalidArgument(
            f"the scene's triangles pass through {total:,} cells, at most {MAX_SAMPLES:,}: "
            "too many surfaces above each other; remove what nobody can stand on or bump into",
            "mesh.data",
        )
    return expand(first, last)


def _ratio(above: Array, below: Array) -> Array:
    """The quotient, 0 where `below` is 0."""
    return np.divide(above, below, out=np.zeros(np.broadcast(above, below).shape), where=below != 0)


def _nothing() -> Spans:
    return Spans(np.empty(0, np.int64), np.empty(0), np.empty(0), np.empty(0, np.int64))
