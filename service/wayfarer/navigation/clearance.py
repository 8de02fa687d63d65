"""The clearance field: signed distance to the nearest wall, sampled on a grid.

Distances are exact to the outlines at the middles of cells (not counted in cells), and bilinear in
between. They are cut at `REACH`, so that an update stays local.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray

from wayfarer.navigation.algorithms import nearest_cell
from wayfarer.navigation.grid import Grid, Window, edges_of, expand

Array = NDArray[np.floating[Any]]

REACH: Final = 3.0
"""Metres: distances to farther walls are not distinguished."""


@dataclass(frozen=True, slots=True)
class ClearanceField:
    """distance [rows, columns] float32, metres: positive on free ground, negative inside walls."""

    grid: Grid
    distance: NDArray[np.float32]

    def sample(self, points: Array) -> tuple[Array, Array]:
        """Distance [...] and the direction [..., 2] in which it grows, at points [..., 2].

        The direction has length 1 near a wall and shrinks to 0 where walls are equally far or
        farther than `REACH`.
        """
        return self.at(points), self._slope(points)

    def at(self, points: Array) -> Array:
        """Distance [...] at points [..., 2]."""
        from wayfarer.navigation.sampling import bilinear

        grid = self.grid
        return bilinear(self.distance, points, (*grid.origin, grid.cell, 0.5))

    def _slope(self, points: Array) -> Array:
        """Gradient by central differences one cell apart. [..., 2]"""
        from wayfarer.navigation.sampling import bilinear

        places = self.grid.places(points)
        step = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        around = bilinear(self.distance, places[..., None, :] + step)  # [..., 4]
        slope = (around[..., [0, 2]] - around[..., [1, 3]]) / (2 * self.grid.cell)
        return slope / np.maximum(np.linalg.norm(slope, axis=-1, keepdims=True), 1.0)

    def changed(
        self, ground: shapely.Geometry, where: tuple[float, float, float, float]
    ) -> "ClearanceField":
        """The field after a change of the ground within the bounds `where`; the rest is kept."""
        inner = self.grid.window(where, REACH)
        outer = self.grid.window(where, 2 * REACH)
        distance = self.distance.copy()
        fresh = _distances(ground, self.grid.part(outer))
        distance[inner] = fresh[_within(inner, outer)]
        return ClearanceField(self.grid, distance)


def clearance_field(ground: shapely.Geometry, grid: Grid) -> ClearanceField:
    """The field of an area of free ground."""
    return ClearanceField(grid, _distances(ground, grid))


def _within(inner: Window, outer: Window) -> Window:
    rows, columns = inner
    return (
        slice(rows.start - outer[0].start, rows.stop - outer[0].start),
        slice(columns.start - outer[1].start, columns.stop - outer[1].start),
    )


def _distances(ground: shapely.Geometry, grid: Grid) -> NDArray[np.float32]:
    """Signed distance of the middles of all cells, cut at ± REACH. [rows, columns]

    A distance transform finds the nearest cell with an outline, and so the nearest edge. The
    distance is that to the edge itself. A neighbour may know a nearer edge, and passes it on.
    """
    free = grid.fill(ground)
    starts, ends = edges_of(ground)
    owner = _owners(starts, ends, grid)
    if (owner >= 0).sum() == 0:
        return np.where(free, REACH, -REACH).astype(np.float32)
    nearest = owner[nearest_cell(owner >= 0)]
    x, y = np.meshgrid(*grid.middles())
    best = _to_edges(x, y, starts, ends, nearest)
    for axis, shift in ((0, 1), (0, -1), (1, 1), (1, -1)):
        candidate = np.roll(nearest, shift, axis)
        other = _to_edges(x, y, starts, ends, candidate)
        nearest = np.where(other < best, candidate, nearest)
        best = np.minimum(best, other)
    best = np.minimum(np.sqrt(best), REACH)
    return np.where(free, best, -best).astype(np.float32)


def _owners(starts: Array, ends: Array, grid: Grid) -> NDArray[np.int64]:
    """An edge that passes through each cell, or -1. [rows, columns]"""
    owner = np.full(grid.shape, -1)
    a, b = grid.places(starts), grid.places(ends)
    count = np.ceil(2 * np.abs(b - a).max(-1)).astype(int) + 1
    edge, k = expand(np.zeros(len(count), int), count + 1)
    spots = a[edge] + (b - a)[edge] * (k / count[edge])[:, None]
    column, row = np.rint(spots).astype(int).T
    inside = (row >= 0) & (row < grid.rows) & (column >= 0) & (column < grid.columns)
    owner[row[inside], column[inside]] = edge[inside]
    return owner


def _to_edges(x: Array, y: Array, starts: Array, ends: Array, edge: NDArray[np.int64]) -> Array:
    """Squared distance of every (x, y) to its edge."""
    (ax, ay), (dx, dy) = starts.T, (ends - starts).T
    px, py = x - ax[edge], y - ay[edge]
    ex, ey = dx[edge], dy[edge]
    share = np.clip((px * ex + py * ey) / np.maximum(ex * ex + ey * ey, 1e-12), 0, 1)
    return (px - share * ex) ** 2 + (py - share * ey) ** 2
