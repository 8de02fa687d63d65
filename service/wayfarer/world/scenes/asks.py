"""Who asks a standing agent to step aside: one that is stuck since the agent closes its way, or one
that stands or waits in it. World's frame, metres.
"""

from functools import cache
from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.world.avoidance.people import People
from wayfarer.world.output.turns import apart
from wayfarer.world.rows import Flags, Float, Index
from wayfarer.world.scenes.cells import Cells, beside, cells_of
from wayfarer.world.scenes.company import PATIENCE, TOUCH
from wayfarer.world.scenes.people import Gathering, PeopleColumns

SIGHT: Final = 2.5
"""Metres ahead of an agent within which people make way for it."""

CLOSES: Final = 0.5
"""Metres to either side of its way within which a person closes it."""


class Neighbours(NamedTuple):
    """Everybody of some sessions [N], for compiled rules."""

    people: PeopleColumns
    cells: Cells
    stand: Flags
    asks: Flags  # it is stuck

    @classmethod
    def of(cls, crowd: Gathering) -> "Neighbours":
        """The people of a gathering."""
        people = crowd.people
        columns = PeopleColumns.of(people, crowd.own)
        return cls(columns, crowd.cells, crowd.stand, is_stuck(people))


class Asks(NamedTuple):
    """Whom some people [A] step aside for: a row of everybody, or -1."""

    touches: Index  # the nearest at rest that is still where the person stands
    asks: Index  # the nearest that is stuck since the person closes its way
    comes: Index  # the nearest whose way a person that has stepped aside would close at its place
    way: Float  # [A, 2] unit vector: that one's way, or one through the first, past the person
    left: Float  # [A] metres from that way to the person, to the left

    @classmethod
    def empty(cls, count: int) -> "Asks":
        """Nobody."""
        touches, asks, comes = np.full((3, count), -1)
        way, left = np.zeros((count, 2), np.float32), np.zeros(count, np.float32)
        return cls(touches, asks, comes, way, left)


def is_stuck(people: People) -> Flags:
    """Whether a walker asks others to make way: they close its way, or leave too little room."""
    return people.walks & (np.maximum(people.aims.barred, people.memory.waited) > PATIENCE)


@compiled
def find_asks(
    them: Neighbours,
    mine: Index,
    hips: Float,
    homes: Float,
    stays: Flags,
    aside: Flags,
    found: Asks,
) -> None:
    """Finds for whom people at rows `mine` [A], at `hips` [A, 2], with places at `homes` [A, 2],
    step aside.

    A person asks while it is stuck. A person that has stepped `aside` [A] stays there for everybody
    that comes. If it does not stay (`stays` [A]), it only steps out of another one.
    """
    for row in range(len(mine)):
        me = mine[row]
        touches = found.touches[row] = _toucher(them, me)
        if aside[row]:
            found.comes[row] = _comer(them, me, homes, row, True, found)
        if stays[row] and touches < 0:
            found.asks[row] = _comer(them, me, hips, row, False, found)
        if touches >= 0:
            x = them.people.position[me, 0] - them.people.position[touches, 0]
            y = them.people.position[me, 1] - them.people.position[touches, 1]
            far = np.float32(sqrt(x * x + y * y))
            least = max(far, np.float32(1e-6))
            found.way[row, 0], found.way[row, 1], found.left[row] = y / least, -x / least, far


@inner
def _toucher(them: Neighbours, me: int) -> int:
    """The nearest at rest that is still where person `me` stands, and goes first; or -1."""
    nearest, first = np.float32(TOUCH), -1
    x, y = them.people.position[me, 0], them.people.position[me, 1]
    for side in range(-1, 2):
        begin, end = beside(them.cells, them.people.first[me], x, y, side)
        for k in range(begin, end):
            other = them.cells.rows[k]
            far = apart(them.people.position, me, them.people.position, other)
            if far > nearest or (far == nearest and other > first) or not is_level(them, me, other):
                continue  # of equally near ones the lower row is found
            rests = them.people.velocity[other, 0] == 0 and them.people.velocity[other, 1] == 0
            waits = them.people.walks[other] and them.stand[me]
            if rests and (waits or them.people.number[other] < them.people.number[me]):
                nearest, first = far, other
    return first


@inner
def _comer(them: Neighbours, me: int, places: Float, row: int, anybody: bool, found: Asks) -> int:
    """The nearest, that is stuck or `anybody`, whose way person `me` would close at `places[row]`;
    or -1. Writes the way.
    """
    nearest, first = np.float32(SIGHT), -1
    for side in range(-1, 2):
        begin, end = beside(them.cells, them.people.first[me], places[row, 0], places[row, 1], side)
        for k in range(begin, end):
            other = them.cells.rows[k]
            comes = them.people.walks[other] and (anybody or (them.asks[other] and them.stand[me]))
            if not comes or not is_level(them, me, other):
                continue
            x, y = them.people.preferred[other, 0], them.people.preferred[other, 1]
            long = max(np.float32(sqrt(x * x + y * y)), np.float32(1e-6))
            x, y = x / long, y / long
            to_x = places[row, 0] - them.people.position[other, 0]
            to_y = places[row, 1] - them.people.position[other, 1]
            on, left = to_x * x + to_y * y, x * to_y - y * to_x
            if on <= 0 or abs(left) >= np.float32(CLOSES):
                continue
            if on > nearest or (on == nearest and other > first):
                continue
            goes_x = them.people.spot[other, 0] - them.people.position[other, 0]
            goes_y = them.people.spot[other, 1] - them.people.position[other, 1]
            if on < np.float32(sqrt(goes_x * goes_x + goes_y * goes_y)):
                nearest, first = on, other
                found.way[row, 0], found.way[row, 1], found.left[row] = x, y, left
    return first


@inner
def is_level(them: Neighbours, me: int, other: int) -> bool:
    """Whether another one is on the floor of person `me`."""
    return other != me and abs(them.people.height[other] - them.people.height[me]) < np.float32(1.0)


@cache
def prepare() -> None:
    """Compiles the rule, or loads it, before agents walk."""
    row, flag, place = np.zeros(1, np.int64), np.zeros(1, np.bool_), np.zeros((1, 2), np.float32)
    warm(find_asks, nobody(), row, place, place, flag, flag, Asks.empty(1))


def nobody() -> Neighbours:
    """One person, for `prepare`."""
    row, flag = np.zeros(1, np.int64), np.zeros(1, np.bool_)
    people = PeopleColumns.of(People.empty(1))
    return Neighbours(people, cells_of(row, people.position), flag, flag)
