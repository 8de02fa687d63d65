"""Makes the navigation mesh of a ground for one radius, and repairs it where obstacles change."""

from collections.abc import Sequence
from math import cos, pi
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray

from wayfarer.errors import FailedPrecondition, InvalidArgument, Metres
from wayfarer.navigation.ground.ground import Ground, Layer, size_parts, size_pattern
from wayfarer.navigation.ground.layers import ISLAND_SHARE
from wayfarer.navigation.mesh import NavMesh, build
from wayfarer.navigation.scene_spec import Obstacle, Point3, SceneSpec, Walkable
from wayfarer.navigation.solids import footprint, triangulate

Array = NDArray[np.floating[Any]]
Ints = NDArray[np.int64]

_ARC: Final = 4
"""Segments of a quarter circle around a corner."""
_ROUND: Final = 1 / cos(pi / 4 / _ARC)
"""A polygon's corners are this much farther out than its sides, which must keep the radius."""
_GAP: Final = 1e-3
"""Metres by which a hole is enlarged, so that it leaves no crack."""
_STRAIGHT: Final = 1e-7
"""Metres: a point is no corner if the next one is this close to the line of its incoming edge."""
MAX_MESH_TRIANGLES: Final = 200_000


def open_ground(layer: Layer, radius: float) -> shapely.Geometry:
    """The area of a layer without obstacles where an agent's middle may be."""
    free = shapely.buffer(layer.ground, -radius * _ROUND, quad_segs=_ARC)
    return free if layer.own is layer.ground else shapely.intersection(free, layer.own)


def grown(shape: shapely.Geometry, radius: float) -> shapely.Geometry:
    """The area around a shape where an agent's middle may not be."""
    return shapely.buffer(shape, radius * _ROUND, quad_segs=_ARC)


def blocks(obstacle: Obstacle, layer: Layer, walkable: Walkable) -> bool:
    """Whether a body on this layer would touch the obstacle, at its outline or its middle."""
    shape = footprint(obstacle)
    spots = np.concatenate([shapely.get_coordinates(p) for p in (shape, shape.centroid)])
    floor = layer.heights.at(spots)
    top = obstacle.bottom + obstacle.height
    in_the_way = (obstacle.bottom < floor + walkable.height) & (top > floor + walkable.step_height)
    return bool(in_the_way.any())


def bake_mesh(spec: SceneSpec, ground: Ground, open_areas: Sequence[shapely.Geometry]) -> NavMesh:
    """Triangulates all layers and keeps the islands that matter."""
    pieces = [triangulate(area) for area in open_areas]
    corners = np.concatenate(pieces)
    layer = np.repeat(np.arange(len(pieces)), [len(piece) for piece in pieces])
    if len(corners) == 0:
        raise InvalidArgument(
            "the ground is nowhere wide enough for bodies of the radius {} (walkable.radius)"
            + size_pattern(spec, ground),
            "walkable.radius",
            Metres(spec.walkable.radius),
            *size_parts(ground),
        )
    if len(corners) > MAX_MESH_TRIANGLES:
        raise InvalidArgument(
            f"the walkable ground has {len(corners):,} triangles, at most {MAX_MESH_TRIANGLES:,}: "
            "its outlines are too detailed",
            "solids",
        )
    mesh = build(corners, layer, slack_of(ground))
    kept = np.isin(mesh.island, _that_matter(mesh, ground, spec.entries))
    return mesh if kept.all() else build(corners[kept], layer[kept], slack_of(ground))


def within(mesh: NavMesh, number: int, area: shapely.Geometry) -> shapely.Geometry:
    """The parts of a layer's open area that the mesh covers: omitted islands stay omitted."""
    parts = shapely.get_parts(area)
    spots = shapely.point_on_surface(parts)
    part, triangle = mesh.tree.query(spots, "intersects")
    return shapely.union_all(parts[np.unique(part[mesh.layer[triangle] == number])])


def slack_of(ground: Ground) -> float:
    """Metres by which the borders of layers may be apart: each outline is smoothed by itself."""
    return 1.5 * ground.cell


def repair(
    mesh: NavMesh,
    number: int,
    open_area: shapely.Geometry,
    opened: shapely.Geometry,
    closed: shapely.Geometry,
    others: shapely.Geometry,
    slack: float,
) -> NavMesh:
    """The mesh after a change on layer `number`: only triangles that meet the change are replaced.

    `opened`, `closed`, `others`: grown outlines of the removed obstacle, of the added one, and of
    all that stand nearby afterwards.
    """
    change = shapely.buffer(shapely.union(opened, closed), _GAP)
    hit = mesh.touching(change)
    hit = hit[mesh.layer[hit] == number]
    freed = shapely.intersection(shapely.buffer(opened, _GAP), open_area)
    hole = shapely.union(shapely.union_all(shapely.polygons(mesh.corners[hit])), freed)
    hole = shapely.difference(hole, shapely.union(others, closed))
    kept = np.ones(len(mesh.corners), bool)
    kept[hit] = False
    around = mesh.touching(hole)
    fresh = triangulate(_without_spare_corners(hole, mesh.corners[around[kept[around]]]))
    if not kept.any() and len(fresh) == 0:
        raise FailedPrecondition("the obstacle would leave no free ground in the scene")
    return build(
        np.concatenate([mesh.corners[kept], fresh]),
        np.concatenate([mesh.layer[kept], np.full(len(fresh), number)]),
        slack,
    )


def _without_spare_corners(area: shapely.Geometry, neighbours: Array) -> shapely.Geometry:
    """The area without corners on straight lines, except those shared with its neighbours.

    A removed obstacle leaves such corners on outlines; they would accumulate with every change.
    """
    shared = set(map(tuple, neighbours.reshape(-1, 2).tolist()))

    def are_shared(spots: Array) -> NDArray[np.bool_]:
        return np.array([spot in shared for spot in map(tuple, spots.tolist())], bool)

    def needed(ring: shapely.LinearRing) -> Array:
        spots = shapely.get_coordinates(ring)[:-1]
        # One of several corners at one place stays: an edge without length makes all look straight.
        apart = np.linalg.norm(spots - np.roll(spots, 1, 0), axis=1) > _STRAIGHT
        spots = spots[apart | are_shared(spots)]
        before, after = spots - np.roll(spots, 1, 0), np.roll(spots, -1, 0) - spots
        across = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
        bends = across > _STRAIGHT * np.linalg.norm(before, axis=1)
        return spots[bends | are_shared(spots)]

    polygons = [part for part in shapely.get_parts(area) if part.area > 0]
    rings = [[needed(ring) for ring in (p.exterior, *p.interiors)] for p in polygons]
    return shapely.MultiPolygon(
        [
            shapely.Polygon(outer, [hole for hole in holes if len(hole) >= 3])
            for outer, *holes in rings
            if len(outer) >= 3
        ]
    )


def _that_matter(mesh: NavMesh, ground: Ground, entries: tuple[Point3, ...]) -> Ints:
    """Islands with an entry on them (or nearest to one); without entries, large ones."""
    if not entries:
        return np.flatnonzero(mesh.areas >= ISLAND_SHARE * mesh.areas.max())
    middles = mesh.corners.mean(1)
    heights = np.empty(len(middles))
    for number, layer in enumerate(ground.layers):
        mine = mesh.layer == number
        heights[mine] = layer.heights.at(middles[mine])
    found = []
    for x, y, z in entries:
        under = mesh.under((x, y))
        if len(under) == 0:
            gaps = np.linalg.norm(middles - (x, y), axis=1) + np.abs(heights - z)
            under = gaps.argmin(keepdims=True)
        found.append(mesh.island[under[np.abs(heights[under] - z).argmin()]])
    return np.unique(found)
