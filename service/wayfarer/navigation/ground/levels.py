"""Which cells can be stood on, at which heights, and how they hang together."""

from dataclasses import dataclass
from math import cos, radians
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.algorithms import components, links
from wayfarer.navigation.grid import Grid, expand
from wayfarer.navigation.ground.raster import Spans, covered, touched
from wayfarer.navigation.scene_spec import Walkable

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.floating[Any]]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_TOLERANCE = 1e-3
"""Metres: a step of exactly the step height is a step."""


@dataclass(frozen=True, slots=True)
class Stands:
    """Places to stand, sorted by cell and height. cell, z [n]; links [n, n]: one step apart."""

    grid: Grid
    cell: Ints
    z: Array
    links: "csr_array"

    def pick(self, which: Mask | Ints) -> "Stands":
        """Some of them."""
        return Stands(self.grid, self.cell[which], self.z[which], self.links[which][:, which])

    def components(self) -> Ints:
        """The number of the connected component of each. [n]"""
        return components(self.links)[1]


def stands(corners: Array, grid: Grid, walkable: Walkable) -> Stands:
    """Where an agent can stand: on ground that is not too steep, with room for a body above it.

    Whatever is no higher than a step is not in a body's way.
    """
    sides = corners[:, 1:] - corners[:, :1]
    normals = np.cross(sides[:, 0], sides[:, 1])
    # either side may be the upper one: many files have inconsistent windings, and the underside of
    # a slab is no floor anyhow, since the slab's top is too close above it
    flat = np.abs(normals[:, 2]) >= cos(radians(walkable.slope_deg)) * np.linalg.norm(
        normals, axis=1
    )
    floors = covered(corners[flat], grid)
    walls = touched(corners[~flat], grid)
    order = np.lexsort((floors.high, floors.cell))
    cell, z = floors.cell[order], floors.high[order]
    kept = np.ones(len(z), bool)
    kept[:-1] = (cell[1:] != cell[:-1]) | (z[1:] - z[:-1] >= walkable.height)
    cell, z = cell[kept], z[kept]
    free = ~_hit(cell, z, walls, walkable)
    cell, z = cell[free], z[free]
    return Stands(grid, cell, z, _links(cell, z, grid, walkable.step_height + _TOLERANCE))


def _hit(cell: Ints, z: Array, walls: Spans, walkable: Walkable) -> Mask:
    """Places whose body a wall passes through. cell, z [n] sorted by cell → [n]"""
    wall, place = expand(
        np.searchsorted(cell, walls.cell), np.searchsorted(cell, walls.cell, "right")
    )
    above = walls.high[wall] > z[place] + walkable.step_height + _TOLERANCE
    below = walls.low[wall] < z[place] + walkable.height
    hit = np.zeros(len(z), bool)
    hit[place[above & below]] = True
    return hit


def _links(cell: Ints, z: Array, grid: Grid, step: float) -> "csr_array":
    """Pairs of places in neighbouring cells that one step leads over."""
    pairs = []
    for offset in (1, grid.columns):
        # no cell of the last column is filled (the grid has a margin): rows do not run together
        one, other = expand(
            np.searchsorted(cell, cell + offset), np.searchsorted(cell, cell + offset, "right")
        )
        near = np.abs(z[one] - z[other]) <= step
        pairs.append((one[near].astype(np.int32), other[near].astype(np.int32)))
    one, other = (np.concatenate(side) for side in zip(*pairs, strict=True))
    return links(len(z), np.concatenate([one, other]), np.concatenate([other, one]))


def without_edges(places: Stands, step: float) -> Mask:
    """Places that stay when no two neighbours of a layer may differ by more than a step. [n]

    At the foot of a drop, the lower one goes.
    """
    sheet = np.full(places.grid.rows * places.grid.columns, np.nan)
    sheet[places.cell] = places.z
    sheet = sheet.reshape(places.grid.shape)
    low = np.zeros(places.grid.shape, bool)
    with np.errstate(invalid="ignore"):
        for axis in (0, 1):
            for shift in (1, -1):
                low |= np.roll(sheet, shift, axis) - sheet > step + _TOLERANCE
    return ~low.reshape(-1)[places.cell]
