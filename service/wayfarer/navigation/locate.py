"""Points of clients → places on the navigation mesh."""

from dataclasses import dataclass
from math import dist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.ground.ground import Ground
from wayfarer.navigation.mesh import NavMesh
from wayfarer.navigation.scene_spec import Point2, Point3, Walkable

Ints = NDArray[np.int64]
Array = NDArray[np.floating[Any]]


@dataclass(frozen=True, slots=True)
class MeshPoint:
    """A point of the mesh. `moved`: metres from the point asked for, in plan."""

    triangle: int
    spot: Point2
    height: float
    moved: float

    @property
    def point(self) -> Point3:
        """The point in world space."""
        return *self.spot, self.height


def nearest_place(
    mesh: NavMesh,
    ground: Ground,
    point: Point2 | Point3,
    walkable: Walkable,
    among: Ints | None = None,
) -> MeshPoint:
    """The place under the point, or else the nearest one; of the mesh, or of some triangles.

    A point with a height means the storey below it, even if that place is not free: hips and table
    tops belong to the floor below them. So every storey offers its nearest place, and a metre of
    height counts as a metre along. Ground more than a step above the point counts as farther by a
    body's height. A point without a height means the lowest storey there.
    """

    def away(place: MeshPoint) -> float:
        rise = place.height - point[2] if len(point) == 3 else 0.0
        return place.moved + abs(rise) + walkable.height * (rise > walkable.step_height)

    x, y = float(point[0]), float(point[1])
    held = np.sort(mesh.under((x, y)))
    if among is not None:
        held = np.intersect1d(held, among)
    places = [_place(mesh, ground, int(triangle), (x, y), 0.0) for triangle in held]
    if not any(away(place) <= walkable.step_height for place in places):
        among = np.arange(len(mesh.corners)) if among is None else among
        layers = mesh.layer[among]
        elsewhere = np.setdiff1d(np.flatnonzero(np.bincount(layers)), mesh.layer[held])
        for number in elsewhere:
            triangle, spot = mesh.closest((x, y), among[layers == number])
            places.append(_place(mesh, ground, triangle, spot, dist((x, y), spot)))
    return min(places, key=lambda place: (away(place), place.height))


def _place(mesh: NavMesh, ground: Ground, triangle: int, spot: Point2, moved: float) -> MeshPoint:
    height = float(ground.layers[mesh.layer[triangle]].heights.at(np.array(spot)))
    return MeshPoint(triangle, spot, height, moved)
