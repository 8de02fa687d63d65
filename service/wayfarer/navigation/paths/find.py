"""Finds a path between two places: search, funnel, then a step back from corners."""

from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.ground.ground import Ground
from wayfarer.navigation.locate import MeshPoint
from wayfarer.navigation.mesh import NavMesh, Portal
from wayfarer.navigation.paths.funnel import length, pull
from wayfarer.navigation.paths.search import corridor

Array = NDArray[np.floating[Any]]


class Clearance(Protocol):
    """What widening asks of a scene, at points [..., 3]."""

    def distance(self, points: Array) -> Array:
        """Distance to the nearest wall. [...]"""

    def clearance(self, points: Array) -> tuple[Array, Array]:
        """The same, and the direction in which it grows. [..., 2]"""


COMFORT: Final = (0.2, 0.1, 0.05)
"""Metres beyond the radius that a path keeps from corners where it can, the most first."""
DETOUR: Final = 1.025
"""How much longer a path may become by it."""
_SPACING: Final = 0.1
_SURE: Final = 1.013
"""Share of the radius that the clearance field must show; between its samples it may be slightly
too large. The funnel's own corners pass: they are 2 % farther out."""


def shortest(mesh: NavMesh, ground: Ground, start: MeshPoint, goal: MeshPoint) -> Array | None:
    """Waypoints [P, 3] of a short way; None where there is none.

    The best of three searches, which are the same three from goal to start: there and back are
    equally long.
    """
    one, other = sorted((start, goal), key=lambda place: place.spot)
    searches = ((one, other, True), (other, one, True), (one, other, False))
    ways = []
    for first, last, aim in searches:
        portals = corridor(mesh, first.triangle, last.triangle, first.spot, last.spot, aim)
        if portals is None:
            return None
        way = pull(first.spot, last.spot, portals)
        ways.append((length(way), first, portals, way))
    _, first, portals, way = min(ways, key=lambda found: found[0])
    points = _lifted(mesh, ground, first, portals, way)
    return points if first is start else points[::-1]


def _lifted(
    mesh: NavMesh,
    ground: Ground,
    start: MeshPoint,
    portals: list[Portal],
    way: list[tuple[tuple[float, float], int]],
) -> Array:
    """The string's corners on the floor of the layer where each one is. [P, 3]"""
    triangles = [start.triangle, *(portal[0] for portal in portals)]
    spots = np.array([spot for spot, _ in way])
    layers = mesh.layer[[triangles[passed] for _, passed in way]]
    heights = np.empty(len(way))
    for number in set(layers.tolist()):
        mine = layers == number
        heights[mine] = ground.layers[number].heights.at(spots[mine])
    return np.column_stack([spots, heights])


def widened(points: Array, scene: Clearance, radius: float) -> Array:
    """The path with its corners moved away from walls where there is room, at little detour."""
    if len(points) < 3:
        return points
    near, away = scene.clearance(points[1:-1])
    for comfort in COMFORT:
        push = np.clip(radius + comfort - near, 0.0, comfort)[:, None] * away
        moved = points.copy()
        moved[1:-1, :2] += push
        moved = _valid(points, moved, scene, radius)
        if _length(moved) <= DETOUR * _length(points):
            return moved
    return points


def _valid(points: Array, moved: Array, scene: Clearance, radius: float) -> Array:
    """Moved corners; those back in place whose ways to their neighbours come too near a wall."""
    for _ in range(len(points)):
        bad = _tightness(moved, scene) < radius * _SURE
        back = np.zeros(len(points), bool)
        back[:-1] |= bad
        back[1:] |= bad
        back &= (moved != points).any(1)
        if not back.any():
            break
        moved[back] = points[back]
    return moved


def _tightness(points: Array, scene: Clearance) -> Array:
    """The least clearance on each stretch between two waypoints. [P - 1]"""
    samples, owner = sampled(points)
    first = np.searchsorted(owner, np.arange(len(points) - 1))
    return np.minimum.reduceat(scene.distance(samples), first)


def sampled(points: Array) -> tuple[Array, NDArray[np.int64]]:
    """Points every 10 cm along a polyline [P, 3], ends included, and the stretch of each."""
    steps = np.diff(points, axis=0)
    count = np.ceil(np.linalg.norm(steps[:, :2], axis=1) / _SPACING).astype(int) + 1
    owner = np.repeat(np.arange(len(steps)), count)
    k = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    share = k / np.maximum(count[owner] - 1, 1)
    return points[owner] + share[:, None] * steps[owner], owner


def _length(points: Array) -> float:
    return float(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1).sum())
