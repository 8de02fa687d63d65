"""Cells that can be stood on, their heights, and their connections."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.algorithms import components, links
from wayfarer.navigation.grid import Grid, expand
from wayfarer.navigation.ground.raster import Spans, covered, touched
from wayfarer.navigation.meshes.posture import is_level
from wayfarer.navigation.scene_spec import Walkable

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.floating[Any]]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

TOLERANCE = 1e-3
"""Metres: a step of exactly the step height is a step."""


@dataclass(frozen=True, slots=True)
class Stands:
    """Places to stand, sorted by cell and height. cell, z [n]; links [n, n] are one step."""

    grid: Grid
    cell: Ints
    z: Array
    links: "csr_array"

    def pick(self, which: Mask | Ints) -> "Stands":
        """Some of the places."""
        return Stands(self.grid, self.cell[which], self.z[which], self.links[which][:, which])

    def components(self) -> Ints:
        """The number of the connected component of each. [n]"""
        return components(self.links)[1]


@dataclass(frozen=True, slots=True)
class Floors:
    """All surfaces that are flat enough, sorted by cell and height: cell, z, headroom [n].

    `room`: metres from the floor up to whatever is in a body's way; infinite under the sky.
    `triangle`: the triangle that each belongs to.
    """

    grid: Grid
    cell: Ints
    z: Array
    room: Array
    triangle: Ints

    def stands(self, which: Mask, step: float) -> Stands:
        """Some of the surfaces, as places to stand."""
        cell, z = self.cell[which], self.z[which]
        return Stands(self.grid, cell, z, _links(cell, z, self.grid, step + TOLERANCE))


def floors(corners: Array, grid: Grid, walkable: Walkable) -> Floors:
    """All surfaces of a scene that are not too steep, and the room above each.

    Surfaces no higher than a step are not in a body's way.
    """
    flat = is_level(corners, walkable)
    level = covered(corners[flat], grid)
    walls = touched(corners[~flat], grid)
    order = np.lexsort((level.high, level.cell))
    cell, z = level.cell[order], level.high[order]
    room = np.full(len(z), np.inf)
    room[:-1] = np.where(cell[1:] == cell[:-1], z[1:] - z[:-1], np.inf)
    room = np.minimum(room, _below_walls(cell, z, walls, walkable))
    return Floors(grid, cell, z, room, np.flatnonzero(flat)[level.triangle[order]])


def _below_walls(cell: Ints, z: Array, walls: Spans, walkable: Walkable) -> Array:
    """Metres up to the lowest wall in a body's way above each place; cell, z [n] sorted by cell."""
    wall, place = expand(
        np.searchsorted(cell, walls.cell), np.searchsorted(cell, walls.cell, "right")
    )
    above = walls.high[wall] > z[place] + walkable.step_height + TOLERANCE
    room = np.full(len(z), np.inf)
    np.minimum.at(room, place[above], np.maximum(walls.low[wall] - z[place], 0.0)[above])
    return room


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

    At the foot of a drop, the lower place is removed.
    """
    sheet = np.full(places.grid.rows * places.grid.columns, np.nan)
    sheet[places.cell] = places.z
    sheet = sheet.reshape(places.grid.shape)
    low = np.zeros(places.grid.shape, bool)
    with np.errstate(invalid="ignore"):
        for axis in (0, 1):
            for shift in (1, -1):
                low |= np.roll(sheet, shift, axis) - sheet > step + TOLERANCE
    return ~low.reshape(-1)[places.cell]
