"""Narrow ways: their width, lanes in which two people keep apart, and turned shoulders.

A way that is narrow for a metre has two lanes; a door has none. An agent that meets another one
there keeps to the right lane. If both do not fit with their shoulders across, each turns the left
shoulder forward, and so its back to the other: a body drifts to where it faces, which is away.
"""

from collections.abc import Callable
from functools import cache
from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, warm
from wayfarer.world.avoidance.kernel import REACTION, Width
from wayfarer.world.avoidance.people import People
from wayfarer.world.rows import Array, Double, Flags, Float, Index

ACROSS: Final = np.arange(-1.2, 1.21, 0.1)
"""Metres to the right of a way at which walls are looked for."""

THIN: Final = 0.15
"""Metres: half of the way from one point to the next, between which a wall with a door may lie."""

LANES: Final = 0.9
"""Half of a way's width within which it has lanes; in wider ones avoidance finds its own."""

LANE: Final = 0.4
"""Distance of a lane from the middle, as a share of the half width."""

STEERS: Final = 0.3
"""Metres farther aside that it heads for, for each metre by which it is off its lane."""

BACK: Final = 4.0
"""Radians by which it turns back for each metre by which it is nearer to the wall than its lane."""

DRIFT: Final = 0.5
"""Metres that it heads to the other side per radian of turn: a body drifts to where it faces."""

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
    place: Array  # [A, 2] where the lane leads
    turn: Array  # radians to the right of the way that it faces; 0: it does not turn
    way: Array  # [A, 2] unit vector


class PeopleColumns(NamedTuple):
    """Columns of `People` [N], and the range of each one's session."""

    first: Index
    last: Index
    position: Float
    height: Float
    velocity: Float
    walks: Flags
    preferred: Float


def lanes(
    people: People,
    rows: Index,
    points: Array,
    distance: Callable[[Array], Array],
    own: tuple[Index, Index] | None = None,
) -> Lane:
    """Lanes of the people at `rows`.

    `points` [A, S, 2]: their ways in the next metres, of which the last point is headed for.
    `distance`: metres to the nearest wall at points [A, P, 2] of these rows, [A, P]. `own` [N]: the
    range [start, end) of each one's session in `people`; None: all are of one.
    """
    # until a body reacts it keeps its velocity
    place, count = people.position[rows] + REACTION * people.velocity[rows], len(people.number)
    way = points[:, -1] - points[:, 0]
    way = way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
    right = np.stack([way[:, 1], -way[:, 0]], -1)
    grid = points[:, :, None] + ACROSS[:, None] * right[:, None, None]
    room = distance(grid.reshape(len(points), -1, 2)).reshape(*points.shape[:2], len(ACROSS))
    low, high = _walls(room, 0.0)
    halves = (high - low) / 2
    left, beyond = _walls(room, THIN)
    half = halves.max(1)
    first, last = own or (np.zeros(count, np.int64), np.full(count, count))
    everybody = PeopleColumns(
        first,
        last,
        people.position,
        people.height,
        people.velocity,
        people.walks,
        people.memory.preferred,
    )
    comes, passes = np.zeros(len(rows), np.bool_), np.zeros(len(rows), np.bool_)
    meet(everybody, rows, np.float64(way), comes, passes)
    keeps = (half < LANES) & comes
    middle = (high[:, -1] + low[:, -1]) / 2
    wanted = middle + LANE * (high - low)[:, -1] / 2
    off = wanted - ((place - points[:, -1]) * right).sum(-1)
    turn = np.where(passes, np.interp(half, TURNS, (TURN, 0.0)) + BACK * np.minimum(off, 0.0), 0.0)
    turn = np.maximum(turn, np.interp(halves.min(1), SQUEEZE, (TURN, 0.0)))
    aim = wanted + STEERS * off - DRIFT * turn
    lane = points[:, -1] + aim[:, None] * right
    width = Width(half.astype(np.float32), ((beyond - left).min(1) / 2).astype(np.float32))
    return Lane(width, keeps, lane, turn, way)


def _walls(room: Array, nearer: float) -> tuple[Array, Array]:
    """Metres to the right at which walls are on both sides of points: [A, S] for each side.

    `room` [A, S, G]: metres to the nearest wall at `ACROSS`. A place with no more room than
    `nearer` counts as one in a wall.
    """
    free, middle = room > nearer, len(ACROSS) // 2
    after = np.logical_and.accumulate(free[..., middle:], -1)
    before = np.logical_and.accumulate(free[..., middle::-1], -1)
    high = np.where(after, ACROSS[middle:] + room[..., middle:], 0).max(-1)
    low = np.where(before, ACROSS[middle::-1] - room[..., middle::-1], 0).min(-1)
    return low, high


@compiled
def meet(them: PeopleColumns, rows: Index, way: Double, comes: Flags, passes: Flags) -> None:
    """Which of `rows` [A] on ways [A, 2] others meet from the other side, and pass soon."""
    for row in range(len(rows)):
        me, x, y = rows[row], way[row, 0], way[row, 1]
        for other in range(them.first[me], them.last[me]):
            wish_x, wish_y = them.preferred[other, 0], them.preferred[other, 1]
            speed = max(np.float32(sqrt(wish_x * wish_x + wish_y * wish_y)), np.float32(1e-6))
            if not them.walks[other] or (x * wish_x + y * wish_y) / speed >= -AGAINST:
                continue
            to_x = them.position[other, 0] - them.position[me, 0]
            to_y = them.position[other, 1] - them.position[me, 1]
            ahead, aside = to_x * x + to_y * y, to_x * y - to_y * x
            if not (PAST < ahead < SEES and abs(aside) < 2 * LANES):
                continue
            if abs(them.height[other] - them.height[me]) < 1.0:
                comes[row] = True
                closing_x = them.velocity[me, 0] - them.velocity[other, 0]
                closing_y = them.velocity[me, 1] - them.velocity[other, 1]
                closing = max(closing_x * x + closing_y * y, 0.5)
                passes[row] = passes[row] or ahead < closing * TURN_SECONDS


@cache
def prepare() -> None:
    """Compiles the rule, or loads it, before agents walk."""
    row, flag, place = np.zeros(1, np.int64), np.zeros(1, np.bool_), np.zeros((1, 2), np.float32)
    everybody = PeopleColumns(row, row, place, place[0, :1], place, flag, place)
    warm(meet, everybody, row, np.float64(place), flag, flag)
