"""Finds a path between two places: A* over triangles, string pulling, a step back from corners.

String pulling finds the shortest way through a corridor of portals (Lee & Preparata 1984).
"""

from collections.abc import Sequence
from heapq import heappop, heappush
from itertools import pairwise
from math import hypot, inf
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.ground.ground import Ground
from wayfarer.navigation.locate import MeshPoint
from wayfarer.navigation.mesh import NavMesh, Portal

Array = NDArray[np.floating[Any]]
Spot = tuple[float, float]


class Clearance(Protocol):
    """The part of a scene that widening uses, at points [..., 3]."""

    def distance(self, points: Array) -> Array:
        """Distance to the nearest wall. [...]"""

    def clearance(self, points: Array) -> tuple[Array, Array]:
        """The same, and the direction in which it grows. [..., 2]"""


COMFORT: Final = (0.2, 0.1, 0.05)
"""Metres beyond the radius that a path keeps from corners where it can, the most first."""
DETOUR: Final = 1.025
"""How much longer this may make a path, as a factor."""
_SPACING: Final = 0.1
_SURE: Final = 1.013
"""Share of the radius that the clearance field must show, since it may be slightly too large
between its samples. The funnel's own corners pass: they are 2 % farther out."""


def shortest(mesh: NavMesh, ground: Ground, start: MeshPoint, goal: MeshPoint) -> Array:
    """Waypoints [P, 3] of a short way between two places of one island.

    The best of three searches, the same three from goal to start: there and back are
    equally long.
    """
    one, other = sorted((start, goal), key=lambda place: place.spot)
    searches = ((one, other, True), (other, one, True), (one, other, False))
    ways = []
    for first, last, aim in searches:
        portals = corridor(mesh, first.triangle, last.triangle, first.spot, last.spot, aim)
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
    """The path with its corners moved away from walls where there is room, with little detour."""
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
    """Moved corners, without moves whose ways to the neighbours come too near a wall."""
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


def pull(start: Spot, goal: Spot, portals: Sequence[Portal]) -> list[tuple[Spot, int]]:
    """The corners of the taut string from start to goal, both included.

    Each corner comes with the number of portals passed before or at it.
    """
    lefts = [*((p[1], p[2]) for p in portals), goal]
    rights = [*((p[3], p[4]) for p in portals), goal]
    way = [(start, 0)]
    apex = left = right = start
    left_at = right_at = index = 0
    while index < len(lefts):
        new_left, new_right = lefts[index], rights[index]
        bend = None
        if _turn(apex, right, new_right) >= 0:  # the right side moves inwards
            if right == apex or _turn(apex, left, new_right) < 0:
                right, right_at = new_right, index
            else:  # across the left side: the string bends there
                bend = left, left_at
        if bend is None and _turn(apex, left, new_left) <= 0:
            if left == apex or _turn(apex, right, new_left) > 0:
                left, left_at = new_left, index
            else:
                bend = right, right_at
        if bend is not None:
            apex, index = bend
            left, right, left_at, right_at = apex, apex, index, index
            way.append((apex, min(index + 1, len(portals))))
        index += 1
    way.append((goal, len(portals)))
    return way[:1] + [corner for last, corner in pairwise(way) if corner[0] != last[0]]


def length(way: Sequence[tuple[Spot, int]]) -> float:
    """Metres along the string."""
    return sum(hypot(b[0] - a[0], b[1] - a[1]) for (a, _), (b, _) in pairwise(way))


def _turn(a: Spot, b: Spot, c: Spot) -> float:
    """Positive when c lies to the left of a → b."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def corridor(
    mesh: NavMesh, first: int, last: int, start: Spot, goal: Spot, aim: bool = True
) -> list[Portal]:
    """The portals of a short way from triangle `first` to `last`, both of one island.

    The length of a way can only be guessed before its string is pulled. It is measured through one
    point of each portal. With `aim` that is its crossing with the straight line to the goal (or the
    nearest end); without it, the point nearest to the one before. Each guess misses short ways that
    the other finds.
    """
    gx, gy = goal
    portals = mesh.portals
    best = {first: 0.0}
    came: dict[int, tuple[int, Portal]] = {}
    queue = [(hypot(gx - start[0], gy - start[1]), 0.0, first, start[0], start[1])]
    while True:  # until `last` comes: every portal leads back, so an island is connected
        _, cost, here, x, y = heappop(queue)
        if here == last:
            return _trace(came, first, last)
        if cost > best[here]:
            continue
        dx, dy = gx - x, gy - y
        for portal in portals[here]:
            there, lx, ly, rx, ry = portal
            least = best.get(there, inf)
            if least <= cost:
                continue
            # the crossing is inlined: most of the time is spent here
            ex, ey = lx - rx, ly - ry
            if aim:
                across = dx * ey - dy * ex
                share = (dy * (rx - x) - dx * (ry - y)) / across if across else 0.5
            else:
                share = ((x - rx) * ex + (y - ry) * ey) / (ex * ex + ey * ey)
            share = 0.0 if share < 0.0 else min(share, 1.0)
            px, py = rx + share * ex, ry + share * ey
            spent = cost + hypot(px - x, py - y)
            if spent < least:
                best[there] = spent
                came[there] = here, portal
                heappush(queue, (spent + hypot(gx - px, gy - py), spent, there, px, py))


def _trace(came: dict[int, tuple[int, Portal]], first: int, last: int) -> list[Portal]:
    way = []
    while last != first:
        last, portal = came[last]
        way.append(portal)
    return way[::-1]
