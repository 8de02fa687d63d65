"""A way on a small grid around obstacles, compiled; see detours.py.

The web client's local mode has the same functions by the same names.
"""

from functools import cache
from math import ceil, floor, inf, sqrt
from typing import Final

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.world.rows import Double, Flags, Float, Index

ROUNDS: Final = 16
"""Maximum sweeps over the grid: each one carries costs around another bend."""

STEPS: Final = ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, -1), (-1, 1))
"""Offsets (rows, columns) of a cell's neighbours."""

DIAGONAL: Final = sqrt(2.0)


@inner
def _sweep(room: Double, least: float, cost: Double) -> bool:
    """Carries costs of cells to neighbours, in four orders; returns whether any changed. Each order
    asks the neighbours that it has passed: together they ask all of them.
    """
    rows, columns = cost.shape
    changed = False
    for order in range(4):
        down, right = 1 if order < 2 else -1, 1 if order % 2 == 0 else -1
        for i in range(rows):
            r = i if down > 0 else rows - 1 - i
            for j in range(columns):
                c = j if right > 0 else columns - 1 - j
                if room[r, c] < least:
                    continue
                best = cost[r, c]
                if j > 0:
                    best = min(best, cost[r, c - right] + 1.0)
                if i > 0:
                    best = min(best, cost[r - down, c] + 1.0)
                    if j > 0:
                        best = min(best, cost[r - down, c - right] + DIAGONAL)
                    if j < columns - 1:
                        best = min(best, cost[r - down, c + right] + DIAGONAL)
                if best < cost[r, c]:
                    cost[r, c] = best
                    changed = True
    return changed


@inner
def _sees(room: Double, least: float, r0: int, c0: int, r1: int, c1: int) -> bool:
    """Whether a straight line between two cells keeps the room, interpolated between cells."""
    rows, columns = room.shape
    steps = ceil(2 * sqrt(float((r1 - r0) ** 2 + (c1 - c0) ** 2)))
    for k in range(steps + 1):
        share = k / max(steps, 1)
        y, x = r0 + share * (r1 - r0), c0 + share * (c1 - c0)
        r, c = min(floor(y), rows - 2), min(floor(x), columns - 2)
        y, x = y - r, x - c
        low = room[r, c] * (1 - x) + room[r, c + 1] * x
        high = room[r + 1, c] * (1 - x) + room[r + 1, c + 1] * x
        if low * (1 - y) + high * y < least:
            return False
    return True


@compiled
def way_around(room: Double, start: Index, end: Index, corners: Index) -> int:
    """Finds a short way between two cells through cells with room.

    room [R, C], R, C ≥ 2: metres more than a body needs. start, end: row and column. The corners,
    including both ends, are written into `corners` [P, 2]; returns their number, 0 without a way. A
    start with too little room is left through cells with no less; instead of an end with too little
    room the way leads to the nearest cell that has room.
    """
    rows, columns = room.shape
    least = min(room[start[0], start[1]], 0.0)
    cost = np.full((rows, columns), inf)
    nearest, end_r, end_c = rows * rows + columns * columns, start[0], start[1]
    for r in range(rows):
        for c in range(columns):
            square = (r - end[0]) ** 2 + (c - end[1]) ** 2
            if room[r, c] >= 0 and square < nearest:
                nearest, end_r, end_c = square, r, c
    if end_r == start[0] and end_c == start[1]:
        return 0
    cost[end_r, end_c] = 0.0
    for _ in range(ROUNDS):
        if not _sweep(room, least, cost):
            break
    r, c = start[0], start[1]
    if cost[r, c] == inf:
        return 0
    corners[0, 0], corners[0, 1] = r, c
    count, from_r, from_c = 1, r, c
    while cost[r, c] > 0:
        best, best_r, best_c = inf, r, c
        for k in range(8):
            y, x = r + STEPS[k][0], c + STEPS[k][1]
            if 0 <= y < rows and 0 <= x < columns:
                whole = cost[y, x] + (1.0 if k < 4 else DIAGONAL)
                if whole < best - 1e-9:  # of equal ones the first: rounding must not choose
                    best, best_r, best_c = whole, y, x
        if cost[best_r, best_c] >= cost[r, c] or count >= len(corners) - 1:
            return 0
        if not _sees(room, least, from_r, from_c, best_r, best_c):
            corners[count, 0], corners[count, 1] = r, c
            count, from_r, from_c = count + 1, r, c
        r, c = best_r, best_c
    corners[count, 0], corners[count, 1] = r, c
    return count + 1


@compiled
def keep_apart(room: Double, low: Double, cell: float, spots: Float, apart: float) -> None:
    """Lowers the room of cells [R, C] to their metres beyond `apart` from each of `spots` [N, 2].

    `low`: where the first cell is; `cell`: metres between two. Cells farther away than the
    neighbours of those without room stay as they are: `way_around` asks for no more.
    """
    rows, columns = room.shape
    reach = (apart + 2 * cell) / cell
    for spot in range(len(spots)):
        x, y = (spots[spot, 0] - low[0]) / cell, (spots[spot, 1] - low[1]) / cell
        for r in range(max(ceil(y - reach), 0), min(floor(y + reach) + 1, rows)):
            for c in range(max(ceil(x - reach), 0), min(floor(x + reach) + 1, columns)):
                away = cell * sqrt((c - x) * (c - x) + (r - y) * (r - y))
                room[r, c] = min(room[r, c], away - apart)


@compiled
def stand_before(
    me: Index,
    hips: Double,
    points: Double,
    own: tuple[Index, Index],
    standing: tuple[Float, Float, Flags],
    beside: float,
    near: Double,
    first: Index,
    by: Flags,
) -> None:
    """Finds the people that stand in the ways of people `me` [A] of their sessions. Writes them to
    `by` [A, S], the nearest one to `first` [A], and the metres to it to `near` [A].

    hips [A, 2]; points [A, P, 2] of their ways; `own` [A]: ranges [start, end) of their sessions.
    `standing` [N]: places, heights, and whether each stands. `beside`: metres from a way that
    belong to it.
    """
    place, height, stand = standing
    for row in range(len(me)):
        begin = own[0][row]
        for other in range(begin, own[1][row]):
            if not stand[other] or other == me[row]:
                continue
            if abs(height[other] - height[me[row]]) >= 1.0:
                continue
            x, y = float(place[other, 0]), float(place[other, 1])
            least = inf
            for point in range(points.shape[1]):
                dx, dy = points[row, point, 0] - x, points[row, point, 1] - y
                least = min(least, dx * dx + dy * dy)
            if sqrt(least) < beside:
                by[row, other - begin] = True
                dx, dy = hips[row, 0] - x, hips[row, 1] - y
                far = sqrt(dx * dx + dy * dy)
                if far < near[row]:
                    near[row], first[row] = far, other


@cache
def prepare() -> None:
    """Compiles the search, or loads it, before agents walk."""
    one, places = np.zeros(1, np.int64), np.zeros((1, 2))
    standing = np.zeros((1, 2), np.float32), np.zeros(1, np.float32), np.zeros(1, np.bool_)
    by = np.zeros((1, 1), np.bool_)
    ways, near = np.zeros((1, 1, 2)), np.ones(1)
    warm(stand_before, one, places, ways, (one, one), standing, 0.3, near, one, by)
    room, corner = np.ones((2, 2)), np.zeros(2, np.int64)
    warm(keep_apart, room, np.zeros(2), 0.15, standing[0], 0.4)
    warm(way_around, room, corner, corner + 1, np.empty((4, 2), np.int64))
