"""Solids and floors as polygons (seen from above) and as triangles."""

from math import cos, pi, sin
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from wayfarer.navigation.scene_spec import Box, Cylinder, Floor, Ramp, Solid

_ARC: Final = 8
"""Segments of a quarter of a cylinder."""
_CORNERS: Final = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
_UPHILL: Final = np.array([0.0, 0.0, 1.0, 1.0, 0.0])
"""Height of a ramp's corners, in the order of `_CORNERS`, as a closed ring."""


def footprint(solid: Solid) -> shapely.Polygon:
    """The outline of the solid, from above. A cylinder's polygon lies around its circle."""
    if isinstance(solid, Cylinder):
        reach = solid.radius / cos(pi / 4 / _ARC)
        return shapely.Point(solid.center).buffer(reach, quad_segs=_ARC)
    if isinstance(solid, Box | Ramp):
        c, s = cos(solid.yaw), sin(solid.yaw)
        corners = (_CORNERS * solid.size) @ np.array([[c, s], [-s, c]])
        return shapely.Polygon(corners + np.asarray(solid.center[:2]))
    return shapely.Polygon([point[:2] for point in solid.outline])


def floor_polygon(floor: Floor) -> shapely.Geometry:
    """The floor without its holes."""
    outline = shapely.Polygon([point[:2] for point in floor.outline])
    holes = [shapely.Polygon([point[:2] for point in ring]) for ring in floor.holes]
    return outline.difference(shapely.union_all(holes))


def solid_triangles(solid: Solid) -> NDArray[np.float64]:
    """Triangles of top and sides [T, 3, 3]. The underside cannot be walked on and is left out."""
    area = shapely.orient_polygons(footprint(solid))
    ring = shapely.get_coordinates(area.exterior)
    rise = solid.height * (_UPHILL if isinstance(solid, Ramp) else np.ones(len(ring)))
    edge = np.column_stack([ring, solid.bottom + rise])
    foot = np.column_stack([ring, np.full(len(ring), solid.bottom)])
    if isinstance(solid, Ramp):
        top = edge[[[0, 1, 2], [0, 2, 3]]]
    else:
        top = at_height(triangulate(area), solid.bottom + solid.height)
    lower = np.stack([foot[:-1], foot[1:], edge[1:]], 1)
    upper = np.stack([foot[:-1], edge[1:], edge[:-1]], 1)
    return np.concatenate([top, lower, upper])


def at_height(corners: NDArray[np.float64], height: float) -> NDArray[np.float64]:
    """Flat triangles [T, 3, 2] in space. [T, 3, 3]"""
    return np.concatenate([corners, np.full((*corners.shape[:2], 1), height)], -1)


def triangulate(area: shapely.Geometry) -> NDArray[np.float64]:
    """Constrained Delaunay triangles of an area, anticlockwise. [T, 3, 2]"""
    found = shapely.get_parts(shapely.constrained_delaunay_triangles(area))
    if len(found) == 0:
        return np.empty((0, 3, 2))
    corners = shapely.get_coordinates(found).reshape(-1, 4, 2)[:, :3]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    clockwise = first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]
    return np.where(clockwise[:, None, None], corners[:, ::-1], corners)
