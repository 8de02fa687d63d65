"""The navigation mesh: connected triangles of ground for an agent's middle."""

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from wayfarer.navigation.algorithms import components, links

Array = NDArray[np.floating[Any]]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]


class Portals(NamedTuple):
    """Edges that lead out of triangles, those of one triangle after the other's."""

    first: Ints  # [T + 1] those of triangle t are first[t] … first[t + 1] - 1
    behind: Ints  # [P] the triangle that one leads to
    ends: NDArray[np.float64]  # [P, 4] left x, y and right x, y, as seen on the way out


_GRAIN = 1e-5
"""Metres: corners closer than this are merged."""
_ALONG = 0.94
"""Cosine from which edges of two layers count as parallel."""


@dataclass(frozen=True, slots=True, eq=False)
class NavMesh:
    """corners [T, 3, 2], anticlockwise. layer, island [T]. areas [islands] in m².

    Every portal has one back, so a way exists between any two triangles of an island.
    """

    corners: Array
    layer: Ints
    portals: Portals
    island: Ints
    areas: NDArray[Any]
    tree: shapely.STRtree

    def under(self, point: tuple[float, float]) -> Ints:
        """Triangles that contain the point, border included, of several layers or neighbours."""
        return self.tree.query(shapely.Point(point), "intersects")

    def touching(self, area: shapely.Geometry) -> Ints:
        """Triangles that meet an area."""
        return self.tree.query(area, "intersects")

    def closest(self, point: tuple[float, float], among: Ints) -> tuple[int, tuple[float, float]]:
        """The nearest of some triangles that do not contain the point, and its nearest point."""
        a = self.corners[among]
        d = np.roll(a, -1, 1) - a
        share = ((point - a) * d).sum(-1) / np.maximum((d * d).sum(-1), 1e-12)
        spots = a + np.clip(share, 0, 1)[..., None] * d  # [n, 3 edges, 2]
        which, edge = divmod(int(((spots - point) ** 2).sum(-1).argmin()), 3)
        x, y = spots[which, edge]
        return int(among[which]), (float(x), float(y))


def build(corners: Array, layer: Ints, slack: float) -> NavMesh:
    """Connects triangles by the edges they share.

    `slack`: metres by which the borders of two layers may be apart where one continues the other.
    """
    shared = [_shared_edges(corners, layer)]
    if layer.max(initial=0) > layer.min(initial=0):
        shared.append(_bordering(corners, layer, shared[0], slack))
    one, other, left, right = (np.concatenate(column) for column in zip(*shared, strict=True))
    count, island = components(links(len(corners), one, other))
    order = np.argsort(one, kind="stable")
    ends = np.concatenate([left, right], -1)[order].astype(np.float64)
    first = np.searchsorted(one[order], np.arange(len(corners) + 1))
    portals = Portals(first, other[order].astype(np.int64), ends)
    polygons = shapely.polygons(corners)
    return NavMesh(
        corners,
        layer,
        portals,
        island,
        np.bincount(island, weights=shapely.area(polygons), minlength=count),
        shapely.STRtree(polygons),
    )


Links: TypeAlias = tuple[Ints, Ints, Array, Array]
"""Triangle, the one behind, left and right end of the portal [n, 2]."""


def _shared_edges(corners: Array, layer: Ints) -> Links:
    """Edges that two triangles of a layer have in common, corner by corner."""
    flat = np.rint(corners.reshape(-1, 2) / _GRAIN).astype(np.int64)
    keyed = np.column_stack([np.repeat(layer, 3), flat])
    names, name = np.unique(keyed, axis=0, return_inverse=True)
    a = name.reshape(-1, 3)
    b = np.roll(a, -1, 1)
    there, back = (a * len(names) + b).reshape(-1), (b * len(names) + a).reshape(-1)
    order = np.argsort(there)
    at = np.minimum(np.searchsorted(there[order], back), max(len(order) - 1, 0))
    mate = order[at]
    # Each edge has one mate and is that edge's mate, also where triangles overlap; an edge without
    # a length has none.
    mutual = (there[mate] == back) & (mate[mate] == np.arange(len(there))) & (there != back)
    edge = np.flatnonzero(mutual & (mate // 3 != np.arange(len(there)) // 3))
    return (
        edge // 3,
        mate[edge] // 3,
        np.roll(corners, -1, 1).reshape(-1, 2)[edge],
        corners.reshape(-1, 2)[edge],
    )


def _bordering(corners: Array, layer: Ints, shared: Links, slack: float) -> Links:
    """Stretches where the borders of two layers run along each other."""
    starts, ends = corners.reshape(-1, 2), np.roll(corners, -1, 1).reshape(-1, 2)
    inner = {(x, y, t) for t, (x, y) in zip(shared[0].tolist(), shared[3].tolist(), strict=True)}
    outer = np.array(
        [(x, y, i // 3) not in inner for i, (x, y) in enumerate(starts.tolist())], bool
    )
    edges = np.flatnonzero(outer & (np.linalg.norm(ends - starts, axis=1) > slack / 10))
    lines = shapely.linestrings(np.stack([starts[edges], ends[edges]], 1))
    i, j = shapely.STRtree(lines).query(lines, "dwithin", distance=slack)
    once = i < j  # a link is measured on one of its edges and counts both ways
    i, j = edges[i[once]], edges[j[once]]
    along = ends[i] - starts[i]
    length = np.linalg.norm(along, axis=1)
    along /= length[:, None]
    back = starts[j] - ends[j]
    back /= np.linalg.norm(back, axis=1)[:, None]
    # the part of edge i that edge j, which runs the other way, covers
    low = np.clip(((ends[j] - starts[i]) * along).sum(1), 0, length)
    high = np.clip(((starts[j] - starts[i]) * along).sum(1), 0, length)
    good = (
        (layer[i // 3] != layer[j // 3])
        & ((along * back).sum(1) > _ALONG)
        & (high - low > slack / 10)
    )
    i, j, along, low, high = i[good], j[good], along[good], low[good], high[good]
    left = starts[i] + high[:, None] * along
    right = starts[i] + low[:, None] * along
    return (
        np.concatenate([i, j]) // 3,
        np.concatenate([j, i]) // 3,
        np.concatenate([left, right]),
        np.concatenate([right, left]),
    )
