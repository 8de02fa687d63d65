"""Points of clients → places on the navigation mesh."""

from dataclasses import dataclass
from math import dist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.ground.ground import Ground
from wayfarer.navigation.mesh import NavMesh
from wayfarer.navigation.spec import Point2, Point3

Ints = NDArray[np.int64]
Array = NDArray[np.floating[Any]]


@dataclass(frozen=True, slots=True)
class Place:
    """A point of the mesh. `moved`: metres from the point asked for, in plan."""

    triangle: int
    spot: Point2
    height: float
    moved: float

    @property
    def point(self) -> Point3:
        """In world space."""
        return *self.spot, self.height


def place_under(mesh: NavMesh, ground: Ground, point: Point2 | Point3) -> Place | None:
    """The place straight under the point (of several storeys the nearest one); None: no ground."""
    found = mesh.under(point[:2])
    if len(found) == 0:
        return None
    heights = _heights(mesh, ground, found, point)
    wanted = point[2] if len(point) == 3 else min(heights)
    best = min(range(len(found)), key=lambda k: abs(heights[k] - wanted))
    return Place(int(found[best]), (float(point[0]), float(point[1])), heights[best], 0.0)


def nearest_place(
    mesh: NavMesh, ground: Ground, point: Point2 | Point3, among: Ints | None = None
) -> Place:
    """The nearest place of the mesh, or of some of its triangles.

    With a height, every storey offers its own nearest place, and one metre up counts as one along.
    """
    among = np.arange(len(mesh.corners)) if among is None else among
    places = []
    for number in np.unique(mesh.layer[among]):
        triangles = among[mesh.layer[among] == number]
        held = np.intersect1d(mesh.under(point[:2]), triangles)
        triangle, spot = (
            (int(held[0]), (float(point[0]), float(point[1])))
            if len(held)
            else mesh.closest(point[:2], triangles)
        )
        height = float(ground.layers[number].heights.at(np.array(spot)))
        places.append(Place(triangle, spot, height, dist(point[:2], spot)))
    rise = (lambda p: abs(p.height - point[2])) if len(point) == 3 else (lambda p: 0.0)
    return min(places, key=lambda place: place.moved + rise(place))


def _heights(mesh: NavMesh, ground: Ground, triangles: Ints, point: Point2 | Point3) -> list[float]:
    spot = np.array(point[:2])
    return [float(ground.layers[layer].heights.at(spot)) for layer in mesh.layer[triangles]]
