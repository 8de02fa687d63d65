"""Finds a path between two places: A* over triangles, string pulling, a step back from corners.

String pulling finds the shortest way through a corridor of portals (Lee & Preparata 1984).
Loaded by the first search: a bake has none.
"""

from functools import cache
from math import hypot, inf
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.ground.ground import Ground
from wayfarer.navigation.locate import MeshPoint
from wayfarer.navigation.mesh import Ints, NavMesh, Portals
from wayfarer.process.compiled import compiled, inner, warm

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
        numbers = corridor(mesh.portals, first.triangle, last.triangle, first.spot, last.spot, aim)
        way = pull(mesh.portals, numbers, first.triangle, first.spot, last.spot)
        ways.append((_length(way[0]), first, way))
    _, first, (spots, triangles) = min(ways, key=lambda found: found[0])
    layers, heights = mesh.layer[triangles], np.empty(len(spots))
    for number in set(layers.tolist()):
        mine = layers == number
        heights[mine] = ground.layers[number].heights.at(spots[mine])
    points = np.column_stack([spots, heights])
    return points if first is start else points[::-1]


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


@compiled
def pull(
    portals: Portals, numbers: Ints, first: int, start: Spot, goal: Spot
) -> tuple[Array, Ints]:
    """The corners [N, 2] of the taut string from start to goal, both included, and the triangle
    [N] that each is in: after the last portal, of those with these numbers, passed before or at it.
    """
    count = len(numbers)
    spots, triangles = np.empty((count + 2, 2)), np.empty(count + 2, np.int64)
    spots[0, 0], spots[0, 1], triangles[0] = start[0], start[1], first
    found, apex, left, right = 1, start, start, start
    left_at = right_at = index = 0
    while index <= count:
        new_left = new_right = goal
        if index < count:
            ends = portals.ends[numbers[index]]
            new_left, new_right = (ends[0], ends[1]), (ends[2], ends[3])
        bends, bend, bend_at = False, apex, 0
        if _turn(apex, right, new_right) >= 0:  # the right side moves inwards
            if right == apex or _turn(apex, left, new_right) < 0:
                right, right_at = new_right, index
            else:  # across the left side: the string bends there
                bends, bend, bend_at = True, left, left_at
        if not bends and _turn(apex, left, new_left) <= 0:
            if left == apex or _turn(apex, right, new_left) > 0:
                left, left_at = new_left, index
            else:
                bends, bend, bend_at = True, right, right_at
        if bends:
            apex = left = right = bend
            index = left_at = right_at = bend_at
        if bends or index == count:
            spot = bend if bends else goal
            if spot[0] != spots[found - 1, 0] or spot[1] != spots[found - 1, 1]:
                spots[found, 0], spots[found, 1] = spot
                passed = min(index + 1, count)
                triangles[found] = portals.behind[numbers[passed - 1]] if passed else first
                found += 1
        index += 1
    return spots[:found], triangles[:found]


@inner
def _turn(a: Spot, b: Spot, c: Spot) -> float:
    """Positive when c lies to the left of a → b."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@compiled
def corridor(portals: Portals, first: int, last: int, start: Spot, goal: Spot, aim: bool) -> Ints:
    """Numbers [N] of the portals of a short way from triangle `first` to `last`, both of one
    island.

    The length of a way can only be guessed before its string is pulled. It is measured through one
    point of each portal. With `aim` that is its crossing with the straight line to the goal (or the
    nearest end); without it, the point nearest to the one before. Each guess misses short ways that
    the other finds.
    """
    gx, gy = goal
    triangles = len(portals.first) - 1
    best, came = np.full(triangles, inf), np.empty((triangles, 2), np.int64)
    best[first], queue, size = 0.0, np.empty((64, 5)), 0
    size = _push(queue, size, hypot(gx - start[0], gy - start[1]), 0.0, first, start)
    while size > 0:  # `last` comes first: every portal leads back, so an island is connected
        cost, here, x, y = queue[0, 1], int(queue[0, 2]), queue[0, 3], queue[0, 4]
        size = _pop(queue, size)
        if here == last:
            break
        if cost > best[here]:
            continue
        dx, dy = gx - x, gy - y
        for number in range(portals.first[here], portals.first[here + 1]):
            there = portals.behind[number]
            if best[there] <= cost:
                continue
            lx, ly, rx, ry = portals.ends[number]
            ex, ey = lx - rx, ly - ry
            share = 0.5
            if not aim:
                share = ((x - rx) * ex + (y - ry) * ey) / (ex * ex + ey * ey)
            elif dx * ey - dy * ex != 0:
                share = (dy * (rx - x) - dx * (ry - y)) / (dx * ey - dy * ex)
            share = min(max(share, 0.0), 1.0)
            px, py = rx + share * ex, ry + share * ey
            spent = cost + hypot(px - x, py - y)
            if spent < best[there]:
                best[there], came[there, 0], came[there, 1] = spent, here, number
                if size == len(queue):
                    queue = np.concatenate((queue, queue))
                guess = spent + hypot(gx - px, gy - py)
                size = _push(queue, size, guess, spent, there, (px, py))
    if best[last] == inf:
        raise ValueError("no portals lead from one triangle to the other")
    count, here = 0, last
    while here != first:
        count, here = count + 1, came[here, 0]
    numbers, here = np.empty(count, np.int64), last
    for k in range(count - 1, -1, -1):
        numbers[k], here = came[here, 1], came[here, 0]
    return numbers


@inner
def _push(queue: Array, size: int, guess: float, spent: float, triangle: int, spot: Spot) -> int:
    """Adds a row to a binary heap, whose least row, number by number, is the first. Returns its
    size.
    """
    at = size
    queue[at, 0], queue[at, 1], queue[at, 2] = guess, spent, triangle
    queue[at, 3], queue[at, 4] = spot
    while at > 0 and _precedes(queue, at, (at - 1) // 2):
        _swap(queue, at, (at - 1) // 2)
        at = (at - 1) // 2
    return size + 1


@inner
def _pop(queue: Array, size: int) -> int:
    """Removes the first row. Returns the size."""
    size, at = size - 1, 0
    _swap(queue, 0, size)
    while 2 * at + 1 < size:
        below = 2 * at + 1
        if below + 1 < size and _precedes(queue, below + 1, below):
            below += 1
        if not _precedes(queue, below, at):
            break
        _swap(queue, at, below)
        at = below
    return size


@inner
def _precedes(queue: Array, one: int, other: int) -> bool:
    for k in range(queue.shape[1]):
        if queue[one, k] != queue[other, k]:
            return queue[one, k] < queue[other, k]
    return False


@inner
def _swap(queue: Array, one: int, other: int) -> None:
    for k in range(queue.shape[1]):
        queue[one, k], queue[other, k] = queue[other, k], queue[one, k]


@cache
def prepare() -> None:
    """Compiles the search, or loads it, before agents walk."""
    portals = Portals(np.zeros(2, np.int64), np.zeros(0, np.int64), np.zeros((0, 4)))
    warm(corridor, portals, 0, 0, (0.0, 0.0), (0.0, 0.0), True)
    warm(pull, portals, portals.behind, 0, (0.0, 0.0), (1.0, 0.0))
