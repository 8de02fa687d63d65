"""Places to stand → layers: each covers a point of the plan at most once.

A component that lies above itself (a house with stairs, a spiral) is cut into bands of height no
thicker than a body, where no two floors can be above each other. Cuts go where the fewest places
are: through stairs, not through floors.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from typing import Any, Final

import numpy as np
import shapely
from contourpy import FillType, contour_generator
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.algorithms import count_pieces, nearest_cell
from wayfarer.navigation.grid import Grid
from wayfarer.navigation.ground.levels import Stands, without_edges
from wayfarer.navigation.scene_spec import Point3, Walkable

Array = NDArray[np.floating[Any]]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

MAX_LAYERS: Final = 16
MAX_PIECES: Final = 10_000
"""Pieces of ground and holes in them, of one layer."""
ISLAND_SHARE: Final = 0.05
"""Islands smaller than this share of the largest are left out, unless an entry is on them."""
_MARGIN: Final = 1.0
"""Metres that a layer knows of its neighbours beyond its own border."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """A layer as cells: its own, those with its surroundings, and heights (NaN elsewhere)."""

    own: Mask
    around: Mask
    height: NDArray[np.float32]


def sheets(places: Stands, entries: tuple[Point3, ...], walkable: Walkable) -> list[Sheet]:
    """The layers of all relevant components, lowest first."""
    component = places.components()
    kept = np.isin(component, _that_matter(places, component, entries))
    places, component = places.pick(kept), component[kept]
    layer = _packed(places, _bands(places, component, walkable))
    if layer.max(initial=0) >= MAX_LAYERS:
        raise InvalidArgument(
            f"the scene has {layer.max() + 1} storeys, at most {MAX_LAYERS}", "mesh.data"
        )
    return [_sheet(places, layer == k, walkable) for k in range(layer.max(initial=-1) + 1)]


def outline(mask: Mask, grid: Grid) -> shapely.Geometry:
    """The cells as polygons: along their edges, with corners cut and steps of one cell smoothed.

    Raises InvalidArgument when there are too many polygons.
    """
    pieces_and_holes = count_pieces(mask) + count_pieces(~mask)
    if pieces_and_holes > MAX_PIECES:
        raise InvalidArgument(
            f"the ground has {pieces_and_holes:,} pieces and holes, at most {MAX_PIECES:,}",
            "mesh.data",
        )
    x, y = grid.middles()
    contours: Any = contour_generator(
        x=x, y=y, z=mask.astype(np.float32), fill_type=FillType.OuterOffset
    )
    pieces, holes = contours.filled(0.5, 2.0)
    rings = [
        [points[a:b] for a, b in pairwise(offsets)]
        for points, offsets in zip(pieces, holes, strict=True)
    ]
    polygons = [shapely.Polygon(ring[0], ring[1:]) for ring in rings]
    return shapely.union_all(polygons).simplify(0.6 * grid.cell)


def _that_matter(places: Stands, component: Ints, entries: tuple[Point3, ...]) -> Ints:
    """Components with an entry on them; without entries, large ones."""
    sizes = np.bincount(component)
    if not entries:
        return np.flatnonzero(sizes >= ISLAND_SHARE * sizes.max(initial=1))
    x, y = places.grid.middles()
    row, column = np.divmod(places.cell, places.grid.columns)
    where = np.stack([x[column], y[row], places.z], -1)
    nearest = [np.linalg.norm(where - np.array(e), axis=1).argmin() for e in entries]
    return np.unique(component[nearest])


def _bands(places: Stands, component: Ints, walkable: Walkable) -> Ints:
    """A number for every place, such that places of one number are nowhere above each other."""
    pair = component * (places.grid.rows * places.grid.columns) + places.cell
    order = np.argsort(pair, kind="stable")
    again = pair[order][1:] == pair[order][:-1]
    doubled = np.unique(component[order][1:][again])
    number = component.copy()
    for one in doubled:
        mine = np.flatnonzero(component == one)
        cuts = _cuts(places.z[mine], walkable.height)
        number[mine] = number.max() + 1 + np.searchsorted(cuts, places.z[mine], "right")
    return np.unique(number, return_inverse=True)[1]


def _cuts(z: Array, height: float) -> Array:
    """Heights of the cuts, at most a body's height apart, each through few places."""
    step = height / 20
    bins = np.floor((z - z.min()) / step).astype(int)
    count = np.bincount(bins)
    cuts, last = [], 0
    while last + 20 < len(count):
        window = count[last + 10 : last + 20]
        last += 10 + int(window.argmin())
        cuts.append(z.min() + last * step)
    return np.array(cuts)


def _packed(places: Stands, band: Ints) -> Ints:
    """Sorts bands into the fewest layers, lowest first; bands of a layer do not overlap."""
    layer = np.zeros(len(band), np.int64)
    taken: list[Mask] = []
    cells = places.grid.rows * places.grid.columns
    means = np.bincount(band, places.z) / np.maximum(np.bincount(band), 1)
    for number in np.argsort(means):
        mine = np.flatnonzero(band == number)
        cell = places.cell[mine]
        free = next((k for k, mask in enumerate(taken) if not mask[cell].any()), len(taken))
        if free == len(taken):
            taken.append(np.zeros(cells, bool))
        taken[free][cell] = True
        layer[mine] = free
    return layer


def _sheet(places: Stands, own: Mask, walkable: Walkable) -> Sheet:
    """One layer, with what its neighbours have within reach of its border."""
    known = own.copy()
    edge = own
    for _ in range(ceil(1.5 * (_MARGIN + walkable.radius) / places.grid.cell)):
        edge = (places.links @ edge.astype(np.int32) > 0) & ~known
        taken = np.zeros(places.grid.rows * places.grid.columns, bool)
        taken[places.cell[known]] = True
        edge &= ~taken[places.cell]
        if not edge.any():
            break
        known |= edge
    around = places.pick(known)
    stays = without_edges(around, walkable.step_height)
    mine = own[known]
    return Sheet(
        _mask(around, stays & mine),
        _mask(around, stays),
        _filled(around),
    )


def _mask(places: Stands, which: Mask) -> Mask:
    mask = np.zeros(places.grid.rows * places.grid.columns, bool)
    mask[places.cell[which]] = True
    return mask.reshape(places.grid.shape)


def _filled(places: Stands) -> NDArray[np.float32]:
    """Heights of all cells: where there is no ground, that of the nearest. [rows, columns]"""
    height = np.full(places.grid.rows * places.grid.columns, np.nan, np.float32)
    height[places.cell] = places.z
    height = height.reshape(places.grid.shape)
    return height[nearest_cell(~np.isnan(height))]
