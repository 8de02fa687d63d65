"""Narrow ways: their width, lanes in which two people keep apart, and turned shoulders.

A way that is narrow for a metre has two lanes; a door has none. An agent that meets another one
there keeps to the right lane. If both do not fit with their shoulders across, each turns the left
shoulder forward, and so its back to the other: a body drifts to where it faces, which is away.
"""

from collections.abc import Callable
from functools import cache
from math import inf, sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.world.avoidance.kernel import REACTION, Width
from wayfarer.world.avoidance.people import People
from wayfarer.world.output.legs import packed
from wayfarer.world.output.turns import between
from wayfarer.world.rows import Array, Double, Flags, Float, Index
from wayfarer.world.scenes.people import PeopleColumns

ACROSS: Final = np.arange(-1.2, 1.21, 0.1)
"""Metres to the right of a way at which walls are looked for."""

THIN: Final = 0.15
"""Metres: half of the way from one point to the next, between which a wall with a door may lie."""

LANES: Final = 0.9
"""Half of a way's width within which it has lanes; in wider ones avoidance finds its own."""

LANE: Final = 0.4
"""Distance of a lane from the middle, as a share of the half width."""

STEERS: Final = 0.3
"""Metres farther aside that an agent heads for, per metre by which it is off its lane."""

BACK: Final = 4.0
"""Radians by which an agent turns back per metre that it is nearer to the wall than its lane."""

DRIFT: Final = 0.5
"""Metres that an agent heads to the other side, per radian of turn, since it drifts to where it
faces."""

SEES: Final = 7.0
"""Metres ahead within which an oncoming agent makes an agent keep to its lane."""

PAST: Final = -0.3
"""Metres ahead (negative: behind) of the other until which an agent keeps to its lane."""

AGAINST: Final = 0.5
"""Cosine from which two people walk against each other."""

TURNS: Final = (0.46, 0.66)
TURN: Final = np.radians(40.0)
"""Half widths between which two people that pass turn their shoulders, and the maximum turn."""

SQUEEZE: Final = (0.23, 0.29)
"""Half widths between which a single person turns its shoulders."""

TURN_SECONDS: Final = 1.4
"""Seconds before two people pass from which they turn."""

SIDEWAYS: Final = 0.9
"""Maximum m/s with turned shoulders."""


class Lane(NamedTuple):
    """The demands of narrow ways on some people [A]."""

    width: Width
    keeps: Flags  # whether it walks in its lane
    place: Double  # [A, 2] where the lane leads
    turn: Double  # radians to the right of the way that it faces; 0: it does not turn
    way: Double  # [A, 2] unit vector


def lanes(
    people: People,
    rows: Index,
    points: Double,
    distance: Callable[[Array], Array],
    own: tuple[Index, Index] | None = None,
) -> Lane:
    """Lanes of the people at `rows`.

    `points` [A, S, 2]: their ways in the next metres, of which the last point is headed for.
    `distance`: metres to the nearest wall at points [A, P, 2] of these rows, [A, P]. `own` [N]: the
    range [start, end) of each one's session in `people`; None: all are of one.
    """
    everybody, count = PeopleColumns.of(people, own), len(rows)
    width = Width(np.empty(count, np.float32), np.empty(count, np.float32))
    places, way = np.empty((count, 2)), np.empty((count, 2))
    found = Lane(width, np.empty(count, np.bool_), places, np.empty(count), way)
    across = np.empty((count, points.shape[1] * len(ACROSS), 2))
    look_across(points, way, across)
    find_lanes(everybody, rows, points, packed(distance(across)), found)
    return found


@compiled
def look_across(points: Double, way: Double, across: Double) -> None:
    """Writes points [A, S G, 2] across ways at points [A, S, 2], and the directions of the ways."""
    for row in range(len(points)):
        x, y = points[row, -1, 0] - points[row, 0, 0], points[row, -1, 1] - points[row, 0, 1]
        size = max(sqrt(x * x + y * y), 1e-6)
        x, y = way[row] = x / size, y / size
        for k in range(points.shape[1]):
            for g in range(len(ACROSS)):
                at = k * len(ACROSS) + g
                across[row, at, 0] = points[row, k, 0] + ACROSS[g] * y
                across[row, at, 1] = points[row, k, 1] - ACROSS[g] * x


@compiled
def find_lanes(them: PeopleColumns, rows: Index, points: Double, room: Float, found: Lane) -> None:
    """Finds the lanes of `rows` [A]. `room` [A, S G]: metres from the points of `look_across` to
    walls.
    """
    for row in range(len(rows)):
        me, x, y = rows[row], found.way[row, 0], found.way[row, 1]
        half, narrowest, least, low, high = -inf, inf, inf, 0.0, 0.0
        for k in range(points.shape[1]):
            low, high = _walls(room[row], k, 0.0)
            half, narrowest = max(half, (high - low) / 2), min(narrowest, (high - low) / 2)
            left, right = _walls(room[row], k, THIN)
            least = min(least, right - left)
        comes, passes = _meets(them, me, x, y)
        found.width.most[row], found.width.least[row] = half, least / 2
        found.keeps[row] = half < LANES and comes
        # until a body reacts it keeps its velocity
        to_x = them.position[me, 0] + np.float32(REACTION) * them.velocity[me, 0]
        to_y = them.position[me, 1] + np.float32(REACTION) * them.velocity[me, 1]
        to_x, to_y = to_x - points[row, -1, 0], to_y - points[row, -1, 1]
        wanted = (high + low) / 2 + LANE * (high - low) / 2
        off, turn = wanted - (to_x * y + to_y * -x), 0.0
        if passes:
            turn = between(half, TURNS, (TURN, 0.0)) + BACK * min(off, 0.0)
        found.turn[row] = turn = max(turn, between(narrowest, SQUEEZE, (TURN, 0.0)))
        aim = wanted + STEERS * off - DRIFT * turn
        found.place[row, 0] = points[row, -1, 0] + aim * y
        found.place[row, 1] = points[row, -1, 1] + aim * -x


@inner
def _walls(room: Float, point: int, nearer: float) -> tuple[float, float]:
    """Metres to the right at which walls are on both sides of a point: the left one first.

    `room` [S G]: metres to the nearest wall at `ACROSS`. A place with no more room than `nearer`
    counts as one in a wall.
    """
    first, middle = point * len(ACROSS), len(ACROSS) // 2
    low = high = 0.0
    for g in range(middle, len(ACROSS)):
        if room[first + g] <= np.float32(nearer):
            break
        high = max(high, ACROSS[g] + room[first + g])
    for g in range(middle, -1, -1):
        if room[first + g] <= np.float32(nearer):
            break
        low = min(low, ACROSS[g] - room[first + g])
    return low, high


@inner
def _meets(them: PeopleColumns, me: int, x: float, y: float) -> tuple[bool, bool]:
    """Whether others meet a person on its way (x, y) from the other side, and whether soon."""
    comes = passes = False
    for other in range(them.first[me], them.last[me]):
        to_x = them.position[other, 0] - them.position[me, 0]
        to_y = them.position[other, 1] - them.position[me, 1]
        ahead, aside = to_x * x + to_y * y, to_x * y - to_y * x
        if not (them.walks[other] and PAST < ahead < SEES and abs(aside) < 2 * LANES):
            continue
        wish_x, wish_y = them.preferred[other, 0], them.preferred[other, 1]
        speed = max(np.float32(sqrt(wish_x * wish_x + wish_y * wish_y)), np.float32(1e-6))
        against = (x * wish_x + y * wish_y) / speed < -AGAINST
        if against and abs(them.height[other] - them.height[me]) < 1.0:
            comes = True
            closing_x = them.velocity[me, 0] - them.velocity[other, 0]
            closing_y = them.velocity[me, 1] - them.velocity[other, 1]
            closing = max(closing_x * x + closing_y * y, 0.5)
            passes = passes or ahead < closing * TURN_SECONDS
    return comes, passes


@cache
def prepare() -> None:
    """Compiles the rules, or loads them, before agents walk."""
    row, flag, place = np.zeros(1, np.int64), np.zeros(1, np.bool_), np.zeros((1, 2), np.float32)
    everybody = PeopleColumns.of(People.empty(1))
    points, width = np.zeros((1, 1, 2)), Width(place[0, :1], place[0, :1])
    across = np.zeros((1, len(ACROSS), 2))
    warm(look_across, points, points[0], across)
    lane = Lane(width, flag, points[0], points[0, 0, :1], points[0])
    warm(find_lanes, everybody, row, points, packed(across[..., 0]), lane)
