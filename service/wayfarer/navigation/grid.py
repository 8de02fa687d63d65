"""A regular grid over the floor: its cells, filled polygons, sampling."""

from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]
Window = tuple[slice, slice]


@dataclass(frozen=True, slots=True)
class Grid:
    """Cells [rows, columns]; the middle of cell [r, c] is at origin + (c + ½, r + ½) · cell."""

    origin: tuple[float, float]
    cell: float
    rows: int
    columns: int

    @classmethod
    def over(cls, bounds: tuple[float, float, float, float], cell: float, margin: float) -> "Grid":
        """The grid that covers `bounds` (x0, y0, x1, y1) and a margin around it."""
        x, y = bounds[0] - margin, bounds[1] - margin
        columns = ceil((bounds[2] + margin - x) / cell)
        rows = ceil((bounds[3] + margin - y) / cell)
        return cls((x, y), cell, rows, columns)

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.rows, self.columns

    def places(self, points: Array) -> Array:
        """Points [..., 2] as (column, row) [..., 2]; whole numbers are the middles of cells."""
        return (points[..., :2] - self.origin) / self.cell - 0.5

    def middles(self) -> tuple[Array, Array]:
        """Coordinates of the cells' middles: x [columns] and y [rows]."""
        x = self.origin[0] + (np.arange(self.columns) + 0.5) * self.cell
        y = self.origin[1] + (np.arange(self.rows) + 0.5) * self.cell
        return x, y

    def window(self, bounds: tuple[float, float, float, float], margin: float) -> Window:
        """The part of the grid that covers `bounds` and a margin."""
        low = np.floor(self.places(np.array(bounds[:2]) - margin)).astype(int)
        high = np.ceil(self.places(np.array(bounds[2:]) + margin)).astype(int) + 1
        c0, r0 = np.clip(low, 0, (self.columns, self.rows))
        c1, r1 = np.clip(high, 0, (self.columns, self.rows))
        return slice(int(r0), int(r1)), slice(int(c0), int(c1))

    def part(self, window: Window) -> "Grid":
        """The grid of a window."""
        rows, columns = window
        origin = np.array(self.origin) + np.array([columns.start, rows.start]) * self.cell
        return Grid(
            (float(origin[0]), float(origin[1])),
            self.cell,
            rows.stop - rows.start,
            columns.stop - columns.start,
        )

    def fill(self, area: shapely.Geometry) -> Mask:
        """Cells whose middle lies in the area. [rows, columns]

        Even-odd rule along each row: every edge toggles all cells to the right of where it crosses.
        """
        starts, ends = edges_of(area)
        a, b = self.places(starts), self.places(ends)
        low, high = np.minimum(a[:, 1], b[:, 1]), np.maximum(a[:, 1], b[:, 1])
        first = np.clip(np.ceil(low), 0, self.rows).astype(int)
        last = np.clip(np.ceil(high), 0, self.rows).astype(int)  # rows first … last - 1
        edge, row = expand(first, last)
        share = (row - a[edge, 1]) / (b[edge, 1] - a[edge, 1])
        x = a[edge, 0] + share * (b[edge, 0] - a[edge, 0])
        column = np.clip(np.ceil(x), 0, self.columns).astype(int)
        toggles = np.bincount(
            row * (self.columns + 1) + column, minlength=self.rows * (self.columns + 1)
        )
        crossed = np.cumsum(toggles.reshape(self.rows, self.columns + 1), axis=1)
        return crossed[:, : self.columns] % 2 == 1


def expand(first: NDArray[np.int_], last: NDArray[np.int_]) -> tuple[NDArray[Any], NDArray[Any]]:
    """All (i, k) with first[i] ≤ k < last[i], as two arrays."""
    count = np.maximum(last - first, 0)
    which = np.repeat(np.arange(len(first)), count)
    offset = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    return which, first[which] + offset


def edges_of(area: shapely.Geometry) -> tuple[Array, Array]:
    """Starts and ends [E, 2] of all outlines of an area (or of lines)."""
    lines = shapely.get_parts(shapely.boundary(area) if _is_area(area) else area)
    points, line = shapely.get_coordinates(lines, return_index=True)
    joined = line[1:] == line[:-1]
    return points[:-1][joined], points[1:][joined]


def _is_area(geometry: shapely.Geometry) -> bool:
    return bool(shapely.get_dimensions(geometry) == 2)
