"""Doors and other narrow places: the order of passing, and where the others wait meanwhile.

One direction at a time: an agent enters while others go its way in the passage. If nobody is in it,
the direction goes whose first person would be there first. The others wait, each at a place of its
own, beside the way of the people that come out.
"""

from collections.abc import Callable
from functools import cache
from math import inf, sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.world.agents.velocity import SLOW
from wayfarer.world.avoidance.people import People
from wayfarer.world.output.legs import packed
from wayfarer.world.rows import Array, Double, Flags, Float, Index
from wayfarer.world.scenes.people import PeopleColumns

BESIDE_WAY: Final = 0.5
"""Metres to either side of a way at which its width is measured."""

NARROW: Final = 1.65
"""Metres: narrower places are passed by one direction at a time, unless they have lanes."""

LANES: Final = (1.1, 0.9)
"""Metres: a narrow place at least as wide as the first and longer than the second is passed both
ways at once (see lanes.py). Points of a way are .2 m apart, so a length between two multiples of
that is not decided by rounding."""

OPEN: Final = 0.6
"""Metres from the wall to a place where people may wait."""

INSIDE: Final = 0.8
"""Metres from a narrow stretch of the way within which a person is in it."""

ENTERS: Final = 0.2
"""Metres from the beginning of that stretch within which a person enters it."""

CONTEST: Final = 2.5
"""Metres from a narrow place within which a person is about to enter it."""

EAGER: Final = 1.0
"""Seconds that a walking person is assumed to walk on, so that it is before a standing one."""

HESITATES: Final = 6.0
"""Seconds of waiting after which the nearest of a direction enters an empty narrow place anyway."""

MOUTH: Final = 0.9
ASIDE: Final = 1.2
"""Minimum metres before a narrow place, and to the right of the way there, at which people wait, so
that nobody waits where others come out."""

APART: Final = 0.65
"""Minimum metres between two people that wait: nearer, their shoulders touch."""

PLACES: Final = np.array(
    [(MOUTH + APART * k, ASIDE + APART * n) for k in range(5) for n in range(5)] + [(MOUTH, 0.9)]
)
"""Places where people may wait [P, 2]: metres before the narrow place, and to the right. The last
one is nearest to the way, and is for everybody if no other is free."""

NEARER: Final = 0.5
"""Cost of a metre from the narrow place, relative to that of a metre to walk."""

LAST: Final = 100.0
"""Cost of the last of these places."""

BESIDE: Final = 0.3
STAYS: Final = 0.5
"""Metres from its place within which a walking person stops, and a standing one stays."""

COASTS: Final = 0.35
"""Seconds at its present speed for which a body moves on before it stands."""

AGAINST: Final = 0.3
"""Cosine from which two people walk against each other, or the same way."""


class Turns(NamedTuple):
    """The response of some people [A] to the narrow places ahead of them."""

    waits: Flags
    place: Double  # [A, 2] where a waiting person stands
    there: Flags  # whether it is there


class Narrows(NamedTuple):
    """The narrow places ahead of some people [A]: where each begins, and the way through it."""

    mouth: Double  # [A, 2]
    way: Double  # [A, 2] unit vector


def turns(
    people: People,
    rows: Index,
    points: Double,
    distance: Callable[[Array], Array],
    own: tuple[Index, Index] | None = None,
) -> Turns:
    """Which of the people at `rows` wait before a narrow place, and where.

    `points` [A, S, 2]: their ways ahead, the nearest first. `distance`: metres to the nearest wall
    at points [A, P, 2] of these rows, [A, P]. `own` [N]: the range [start, end) of
    each one's session in `people`; None: all are of one.
    """
    them, count = PeopleColumns.of(people, own), len(rows)
    found = Turns(np.zeros(count, np.bool_), np.zeros((count, 2)), np.zeros(count, np.bool_))
    sides, narrows = np.empty((count, 2 * points.shape[1] + 2, 2)), np.zeros((2, count, 2))
    look_beside(them, rows, points, sides)
    find_turns(them, rows, points, packed(distance(sides)), found.waits, Narrows(*narrows))
    if found.waits.any():
        places = np.empty((count, len(PLACES), 2))
        find_places(Narrows(*narrows), places)
        take_places(them, rows, Narrows(*narrows), places, packed(distance(places)), found)
    return found


@compiled
def look_beside(them: PeopleColumns, rows: Index, points: Double, sides: Double) -> None:
    """Writes points [A, 2 + 2 S, 2] beside people and the points of their ways: first to the right,
    then to the left.
    """
    count = points.shape[1]
    for row in range(len(rows)):
        x, y = float(them.position[rows[row], 0]), float(them.position[rows[row], 1])
        before_x, before_y = x, y
        for k in range(count + 1):
            next_x, next_y = 2 * x - before_x, 2 * y - before_y
            if k < count:
                next_x, next_y = points[row, k, 0], points[row, k, 1]
            on_x, on_y = next_x - x, next_y - y
            long = max(sqrt(on_x * on_x + on_y * on_y), 1e-6)
            on_x, on_y = BESIDE_WAY * on_x / long, BESIDE_WAY * on_y / long
            sides[row, k, 0], sides[row, k, 1] = x + on_y, y - on_x
            sides[row, count + 1 + k, 0], sides[row, count + 1 + k, 1] = x - on_y, y + on_x
            before_x, before_y, x, y = x, y, next_x, next_y


@compiled
def find_turns(
    them: PeopleColumns, rows: Index, points: Double, room: Float, waits: Flags, found: Narrows
) -> None:
    """Finds which of `rows` [A] wait, and the narrow places ahead of them.

    `room` [A, 2 + 2 S]: metres from the points of `look_beside` to walls.
    """
    stretch = np.empty(points.shape[1:])
    for row in range(len(rows)):
        count, least = 0, np.float32(inf)
        for k in range(len(stretch) + 1):
            # metres from wall to wall; large beside one wall
            width = np.float32(2 * BESIDE_WAY) + room[row, k] + room[row, len(stretch) + 1 + k]
            if width >= np.float32(NARROW):
                continue
            if k == 0:  # the person is in it
                break
            stretch[count], least = points[row, k - 1], min(least, width)
            count += 1
        if count > 0:
            wide = least > np.float32(LANES[0])
            waits[row] = _waits(them, rows[row], row, stretch[:count], wide, found)


@inner
def _waits(
    them: PeopleColumns, me: int, row: int, stretch: Double, wide: bool, found: Narrows
) -> bool:
    """Whether a person waits before a narrow stretch [S, 2] of its way, and where that is."""
    mouth_x, mouth_y = stretch[0, 0], stretch[0, 1]
    x, y = stretch[-1, 0] - mouth_x, stretch[-1, 1] - mouth_y
    long = size = sqrt(x * x + y * y)
    if long > LANES[1] and wide:
        return False
    if long <= 0.1:
        x, y = mouth_x - them.position[me, 0], mouth_y - them.position[me, 1]
        size = max(sqrt(x * x + y * y), 1e-6)
    found.mouth[row, 0], found.mouth[row, 1] = mouth_x, mouth_y
    found.way[row, 0], found.way[row, 1] = x / size, y / size
    follows, leader, due, rival, rival_due = False, me, inf, -1, inf
    for other in range(them.first[me], them.last[me]):
        along, at = _heads(them, me, other, row, found)
        if other != me and abs(along) <= AGAINST:
            continue
        gap = inf
        for k in range(len(stretch)):
            x = them.position[other, 0] - stretch[k, 0]
            y = them.position[other, 1] - stretch[k, 1]
            gap = min(gap, sqrt(x * x + y * y))
        # it is in the passage, or has just come out
        if other != me and gap < INSIDE and (at < long + ENTERS if along < 0 else at > -ENTERS):
            if along < 0:
                return True
            follows = True
        closing = them.velocity[other, 0] * found.way[row, 0]
        closing += them.velocity[other, 1] * found.way[row, 1]
        comes = gap - EAGER * max(-closing if along < 0 else closing, 0.0)
        number = them.number[other]  # of two that are due alike, the lower one is the first
        if other == me or (along > 0 and at <= 0):
            if comes < due or (comes == due and number < them.number[leader]):
                leader, due = other, comes
        elif along < 0 and at > 0 and gap < CONTEST:
            comes_first = comes < rival_due
            if comes_first or (comes == rival_due and number < them.number[rival]):
                rival, rival_due = other, comes
    if follows or rival < 0 or (leader == me and them.waited[me] > HESITATES):
        return False
    return rival_due < due or (rival_due == due and them.number[rival] < them.number[leader])


@inner
def _heads(
    them: PeopleColumns, me: int, other: int, row: int, found: Narrows
) -> tuple[float, float]:
    """Cosine between the way of person `other` and the way through a narrow place, and metres by
    which it is past the beginning. Both are 0 if that person stays, or is not on the floor of
    person `me`.
    """
    level = abs(them.height[other] - them.height[me]) < np.float32(1.0)
    if other != me and not (them.walks[other] and them.wants[other] and level):
        return 0.0, 0.0
    way_x, way_y = found.way[row, 0], found.way[row, 1]
    x = them.spot[other, 0] - them.position[other, 0]
    y = them.spot[other, 1] - them.position[other, 1]
    size = max(np.float32(sqrt(x * x + y * y)), np.float32(1e-6))
    to_x = them.position[other, 0] - found.mouth[row, 0]
    to_y = them.position[other, 1] - found.mouth[row, 1]
    return (x / size) * way_x + (y / size) * way_y, to_x * way_x + to_y * way_y


@compiled
def find_places(narrows: Narrows, places: Double) -> None:
    """Writes the places [A, P, 2] where people may wait before narrow places."""
    for row in range(len(places)):
        x, y = narrows.way[row, 0], narrows.way[row, 1]
        for k in range(len(PLACES)):
            back, aside = PLACES[k, 0], PLACES[k, 1]
            places[row, k, 0] = narrows.mouth[row, 0] - back * x + aside * y
            places[row, k, 1] = narrows.mouth[row, 1] - back * y - aside * x


@compiled
def take_places(
    them: PeopleColumns, rows: Index, narrows: Narrows, places: Double, room: Float, found: Turns
) -> None:
    """Chooses a place for each of `rows` that waits. A place is taken if another person of the same
    way would stop there, and nearer to it. `room` [A, P]: metres from `places` to walls.
    """
    costs, stops = np.empty(len(PLACES)), np.empty((len(them.number), 2), np.float32)
    for row in np.flatnonzero(found.waits):
        me, count = rows[row], 0
        for other in range(them.first[me], them.last[me]):
            along, at = _heads(them, me, other, row, narrows)
            if other != me and along > AGAINST and at <= 0:
                stops[count, 0], stops[count, 1] = coasted(them.position, them.velocity, other)
                count += 1
        mine_x, mine_y = coasted(them.position, them.velocity, me)
        for k in range(len(PLACES)):
            x, y = places[row, k, 0], places[row, k, 1]
            off, free = _far(mine_x, mine_y, x, y), room[row, k] > np.float32(OPEN)
            for mate in range(count):
                free = free and _far(stops[mate, 0], stops[mate, 1], x, y) >= min(APART, off)
            away = _far(x, y, narrows.mouth[row, 0], narrows.mouth[row, 1])
            costs[k] = off + NEARER * away if free else inf
        costs[-1] = min(costs[-1], LAST)
        # of equal costs, the first is taken: rounding must not choose
        best = (costs <= costs.min() + 1e-4).argmax()
        found.place[row] = places[row, best]
        x, y = them.velocity[me, 0], them.velocity[me, 1]
        stays = STAYS if np.float32(sqrt(x * x + y * y)) < np.float32(SLOW) else BESIDE
        found.there[row] = _far(mine_x, mine_y, places[row, best, 0], places[row, best, 1]) < stays


@inner
def coasted(position: Float, velocity: Float, row: int) -> tuple[float, float]:
    """Where a person would come to a stand."""
    return (
        position[row, 0] + np.float32(COASTS) * velocity[row, 0],
        position[row, 1] + np.float32(COASTS) * velocity[row, 1],
    )


@inner
def _far(x: float, y: float, to_x: float, to_y: float) -> float:
    return sqrt((x - to_x) * (x - to_x) + (y - to_y) * (y - to_y))


@cache
def prepare() -> None:
    """Compiles the rules, or loads them, before agents walk."""
    row, flag, points = np.zeros(1, np.int64), np.zeros(1, np.bool_), np.zeros((1, 1, 2))
    them = PeopleColumns.of(People.empty(1))
    narrows, room = Narrows(points[0], points[0]), np.ones((1, len(PLACES)), np.float32)
    warm(look_beside, them, row, points, np.zeros((1, 4, 2)))
    warm(find_turns, them, row, points, room[:, :4].copy(), flag, narrows)
    places = np.zeros((1, len(PLACES), 2))
    warm(find_places, narrows, places)
    warm(take_places, them, row, narrows, places, room, Turns(flag, points[0], flag))
