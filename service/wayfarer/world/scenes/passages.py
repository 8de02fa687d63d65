"""Doors and other narrow places: the order of passing, and where the others wait meanwhile.

One direction at a time: an agent enters while others go its way in the passage. If nobody is in it,
the direction goes whose first person would be there first. The others wait, each at a place of its
own, beside the way of those who come out.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from wayfarer.world.agents.velocity import SLOW
from wayfarer.world.avoidance.people import People
from wayfarer.world.rows import Array, Flags, Index, Int

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
"""Seconds of walking on by which who walks is before who stands."""

HESITATES: Final = 6.0
"""Seconds of waiting after which the nearest of a direction enters an empty narrow place anyway."""

MOUTH: Final = 0.9
ASIDE: Final = 1.2
"""Metres before a narrow place, and to the right of the way there, from which on others wait: not
where people come out."""

APART: Final = 0.65
"""Metres between two who wait: nearer, their shoulders touch."""

PLACES: Final = np.array(
    [(MOUTH + APART * k, ASIDE + APART * n) for k in range(5) for n in range(5)] + [(MOUTH, 0.9)]
)
"""Where they may [P, 2], in metres before it and to the right. The last one is nearest to the way,
and is for all where nothing is free."""

NEARER: Final = 0.5
"""Cost of a metre from the narrow place, relative to that of a metre to walk."""

LAST: Final = 100.0
"""Cost of the last of these places."""

BESIDE: Final = 0.3
STAYS: Final = 0.5
"""Metres from its place within which a person stops that walks, and stays where it stands."""

COASTS: Final = 0.35
"""Seconds at its present speed for which a body moves on before it stands."""

AGAINST: Final = 0.3
"""Cosine from which two people walk against each other, or the same way."""


class Turns(NamedTuple):
    """The response of some people [A] to the narrow places ahead of them."""

    waits: Flags
    place: Array  # [A, 2] where a waiting person stands
    there: Flags  # whether it is there


def turns(
    people: People,
    rows: Index,
    points: Array,
    distance: Callable[[Array], Array],
    own: tuple[Index, Index] | None = None,
) -> Turns:
    """Which of the people at `rows` wait before a narrow place, and where.

    `points` [A, S, 2]: their ways ahead, the nearest first. `distance`: metres to the nearest wall
    at points [A, P, 2] of these rows, [A, P]. `own` [N]: the range [start, end) of
    each one's session in `people`; None: all are of one.
    """
    place, count = people.position[rows], len(rows)
    width = _widths(np.concatenate([place[:, None], points], 1), distance)
    narrow = width[:, 1:] < NARROW
    waits, there = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    mouths, directions, spots = np.zeros((count, 2)), np.zeros((count, 2)), np.zeros((count, 2))
    before = np.flatnonzero(narrow.any(1) & (width[:, 0] >= NARROW))
    if not len(before):
        return Turns(waits, spots, there)
    mates = np.zeros((count, len(people.number)), np.bool_)
    every_way = people.aims.spot - people.position
    every_way = every_way / np.maximum(np.sqrt((every_way * every_way).sum(-1)), 1e-6)[:, None]
    every_goes = people.walks & people.aims.wants
    for row in before.tolist():
        first, me = 0 if own is None else int(own[0][rows[row]]), int(rows[row])
        session = slice(first, None if own is None else int(own[1][me]))
        ways, goes, position = every_way[session], every_goes[session], people.position[session]
        height, number, me = people.height[session], people.number[session], me - first
        stretch = points[row][narrow[row]]
        mouth = points[row, int(narrow[row].argmax())]
        ahead = mouth - place[row]
        off = float(np.sqrt((ahead * ahead).sum()))
        way = stretch[-1] - stretch[0]
        long = float(np.sqrt((way * way).sum()))
        if long > LANES[1] and width[row, 1:][narrow[row]].min() > LANES[0]:
            continue
        way = way / long if long > 0.1 else ahead / max(off, 1e-6)
        gaps = position[:, None] - stretch
        gap = np.sqrt((gaps * gaps).sum(-1).min(1))
        others = goes & (np.abs(height - height[me]) < 1.0)
        others[me] = False
        along = ways @ way
        oncoming, same = others & (along < -AGAINST), others & (along > AGAINST)
        at = (position - mouth) @ way
        beyond = at > 0  # a person that has come out does not enter
        # it is in the passage, or has just come out
        inside = (gap < INSIDE) & np.where(along < 0, at < long + ENTERS, at > -ENTERS)
        if (oncoming & inside).any():
            waits[row] = True
        elif not (same & inside).any():
            closing = people.velocity[session] @ way * np.where(along < 0, -1.0, 1.0)
            due = gap - EAGER * np.maximum(closing, 0.0)
            mine, theirs = same & ~beyond, oncoming & beyond & (gap < CONTEST)
            mine[me] = True
            leader = _first(mine, due, number)
            if theirs.any() and not (leader == me and people.memory.waited[rows[row]] > HESITATES):
                waits[row] = _first(mine | theirs, due, number) != leader
        mouths[row], directions[row], mates[row, session] = mouth, way, same & ~beyond
    if waits.any():
        places = _places(mouths, directions)
        free = distance(places) > OPEN
        stops = people.position + COASTS * people.velocity
        slow = np.sqrt((people.velocity * people.velocity).sum(-1)) < SLOW
        for row in np.flatnonzero(waits).tolist():
            me = int(rows[row])
            spot = _free_place(places[row], free[row], stops, me, mates[row], mouths[row])
            off = float(np.linalg.norm(stops[me] - spot))
            spots[row], there[row] = spot, off < (STAYS if slow[me] else BESIDE)
    return Turns(waits, spots, there)


def _widths(points: Array, distance: Callable[[Array], Array]) -> Array:
    """Metres from wall to wall [A, S] across ways at points [A, S, 2]; large beside one wall."""
    steps = np.diff(points, axis=1, append=2 * points[:, -1:] - points[:, -2:-1])
    long = np.maximum(np.sqrt((steps * steps).sum(-1, keepdims=True)), 1e-6)
    right = BESIDE_WAY * np.stack([steps[..., 1], -steps[..., 0]], -1) / long
    room = distance(np.concatenate([points + right, points - right], 1))
    found: Array = 2 * BESIDE_WAY + room[:, : points.shape[1]] + room[:, points.shape[1] :]
    return found


def _first(those: Flags, due: Array, number: Int) -> int:
    """The one of the least `due` [N]; of two alike, that of the lower number."""
    rows = np.flatnonzero(those)
    return int(rows[np.lexsort((number[rows], due[rows]))[0]])


def _places(mouths: Array, ways: Array) -> Array:
    """Where people may wait [A, P, 2], before narrow places [A, 2] on ways [A, 2]."""
    right = np.stack([ways[:, 1], -ways[:, 0]], -1)
    back, aside = PLACES[:, 0, None], PLACES[:, 1, None]
    found: Array = mouths[:, None] - back * ways[:, None] + aside * right[:, None]
    return found


def _free_place(
    places: Array, free: Flags, stops: Array, me: int, mates: Flags, mouth: Array
) -> Array:
    """The place [2] where a person waits: none where others of its way stand, or stop sooner.

    `places` [P, 2]; `stops` [N, 2]: where everybody would come to a stand.
    """
    off = np.linalg.norm(stops[:, None] - places, axis=-1)
    taken = mates[:, None] & (off < APART) & (off < off[me])
    cost = off[me] + NEARER * np.linalg.norm(places - mouth, axis=-1)
    cost = np.where(free & ~taken.any(0), cost, np.inf)
    cost[-1] = min(cost[-1], LAST)
    # of equal costs, the first is taken: rounding must not choose
    found: Array = places[int((cost <= cost.min() + 1e-4).argmax())]
    return found
