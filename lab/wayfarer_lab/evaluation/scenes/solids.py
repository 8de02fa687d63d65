"""Signed distance to what stands in a scene: negative inside. World space, metres."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray

from wayfarer.navigation.scene import Scene
from wayfarer.navigation.scene_spec import Box, Cylinder, Obstacle, Ramp, Solid
from wayfarer.navigation.solids import floor_polygon, footprint

Array = NDArray[np.floating[Any]]

ON_TOP: Final = 0.1
"""Metres between ground and a solid's top within which the ground is that top."""


@dataclass(frozen=True)
class SceneSolid:
    """A solid of a scene."""

    solid: Solid | Obstacle
    walked_on: bool  # its top is ground

    @property
    def disc(self) -> tuple[float, float, float]:
        """A circle around it in plan: x, y, radius."""
        x0, y0, x1, y1 = footprint(self.solid).bounds
        return (x0 + x1) / 2, (y0 + y1) / 2, float(np.hypot(x1 - x0, y1 - y0)) / 2


def standing(scene: Scene) -> list[SceneSolid]:
    """All solids and obstacles of one version of a scene. Those of a mesh file are not known."""
    solids = [SceneSolid(solid, _is_walked_on(scene, solid)) for solid in scene.spec.solids]
    return solids + [SceneSolid(obstacle, False) for obstacle in scene.obstacles.values()]


def _is_walked_on(scene: Scene, solid: Solid) -> bool:
    middle = footprint(solid).representative_point()
    share = 0.5 if isinstance(solid, Ramp) else 1.0
    top = solid.bottom + share * solid.height
    ground = scene.floor(np.array([middle.x, middle.y, top]))
    return bool(abs(ground - top) < ON_TOP)


def ground_height(scene: Scene, solids: Sequence[SceneSolid], points: Array) -> Array:
    """Height of the highest ground below points [..., 3], or up to a step above them. [...]

    From the geometry itself, not from the samples that paths are planned on; -inf where there is
    none. Those of a mesh file are not known.
    """
    reach = points[..., 2] + scene.spec.walkable.step_height
    best = np.full(points.shape[:-1], -np.inf)
    for floor in scene.spec.floors:
        inside = shapely.intersects_xy(floor_polygon(floor), points[..., 0], points[..., 1])
        best = np.where(inside & (floor.height <= reach), np.maximum(best, floor.height), best)
    for solid in (s.solid for s in solids if s.walked_on):
        top = np.full(best.shape, solid.bottom + solid.height)
        if isinstance(solid, Ramp):
            along = _own(solid, points[..., :2])[..., 1] / solid.size[1] + 0.5
            top = solid.bottom + solid.height * along
        inside = _lateral_distance(solid, points[..., :2]) <= 0
        best = np.where(inside & (top <= reach), np.maximum(best, top), best)
    return best


def signed_distance(solid: Solid | Obstacle, points: Array) -> Array:
    """Signed distance of points [..., 3]; near a ramp's edges it may be too small. [...]"""
    lateral = _lateral_distance(solid, points[..., :2])
    low, high = solid.bottom, solid.bottom + solid.height
    above = np.maximum(low - points[..., 2], points[..., 2] - high)
    outside = np.hypot(np.maximum(lateral, 0), np.maximum(above, 0))
    distance: Array = outside + np.minimum(np.maximum(lateral, above), 0)
    if isinstance(solid, Ramp):
        return np.maximum(distance, _above_slope(solid, points))
    return distance


def _lateral_distance(solid: Solid | Obstacle, points: Array) -> Array:
    """Signed distance in plan, of points [..., 2]. [...]"""
    if isinstance(solid, Cylinder):
        return np.linalg.norm(points - np.asarray(solid.center), axis=-1) - solid.radius
    if isinstance(solid, Box | Ramp):
        out = np.abs(_own(solid, points)) - np.asarray(solid.size) / 2
        return np.linalg.norm(np.maximum(out, 0), axis=-1) + np.minimum(out.max(-1), 0)
    area = footprint(solid)
    spots = shapely.points(points)
    edge = shapely.distance(area.boundary, spots)
    return np.where(shapely.contains(area, spots), -edge, edge)


def _own(solid: Box | Ramp, points: Array) -> Array:
    """Points [..., 2] along the solid's own x and y, from its middle."""
    c, s = cos(solid.yaw), sin(solid.yaw)
    return (points - np.asarray(solid.center)) @ np.array([[c, -s], [s, c]])


def _above_slope(ramp: Ramp, points: Array) -> Array:
    """Distance of points [..., 3] from the plane of its slope, negative below. [...]"""
    rise = ramp.height / ramp.size[1]
    along = _own(ramp, points[..., :2])[..., 1] + ramp.size[1] / 2
    return (points[..., 2] - ramp.bottom - rise * along) / np.hypot(1.0, rise)
