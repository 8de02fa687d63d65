"""String pulling: the shortest way through a corridor of portals (Lee & Preparata 1984)."""

from collections.abc import Sequence
from itertools import pairwise
from math import hypot

from wayfarer.navigation.mesh import Portal

Spot = tuple[float, float]


def pull(start: Spot, goal: Spot, portals: Sequence[Portal]) -> list[tuple[Spot, int]]:
    """The corners of the taut string from start to goal, both included.

    With each corner the number of portals passed before or at it.
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
