"""Doors and other narrow places: the order of passing, and where the others wait meanwhile.

One direction at a time: an agent enters while others go its way in the passage or nobody is in it,
and else waits beside the way out of those who come. Of two who would enter, the nearer one goes.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.world.avoidance.people import People
from wayfarer.world.rows import Flags, Index

Array = NDArray[np.floating[Any]]

NARROW: Final = 0.55
"""Metres from the way to the wall below which two people do not pass each other."""

OPEN: Final = 0.6
"""Metres from an agent to the wall from which it is not yet in a narrow place."""

INSIDE: Final = 0.8
"""Metres from a narrow stretch of the way within which a person is in it."""

CONTEST: Final = 2.5
"""Metres from a narrow place within which a person is about to enter it."""

HESITATES: Final = 6.0
"""Seconds of waiting after which the nearest of a direction enters an empty narrow place anyway."""

MOUTH: Final = 1.3
"""Metres from a narrow place at which others wait …"""

ASIDE: Final = 0.9
"""… and metres to the right of the way there."""

AGAINST: Final = 0.3
"""Cosine from which two people walk against each other, or the same way."""


class Turns(NamedTuple):
    """The response of some people [A] to the narrow places ahead of them."""

    waits: Flags
    place: Array  # [A, 2] where a waiting person stands


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
    place = people.position[rows]
    room = distance(np.concatenate([place[:, None], points], 1))
    narrow = room[:, 1:] < NARROW
    waits = np.zeros(len(rows), np.bool_)
    spots = np.zeros((len(rows), 2))
    before = np.flatnonzero(narrow.any(1) & (room[:, 0] >= OPEN))
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
        mine = float(np.sqrt((ahead * ahead).sum()))
        way = stretch[-1] - stretch[0]
        long = float(np.sqrt((way * way).sum()))
        way = way / long if long > 0.1 else ahead / max(mine, 1e-6)
        gaps = position[:, None] - stretch
        gap = np.sqrt((gaps * gaps).sum(-1).min(1))
        others = goes & (np.abs(height - height[me]) < 1.0)
        others[me] = False
        along = ways @ way
        oncoming, same = others & (along < -AGAINST), others & (along > AGAINST)
        inside = gap < INSIDE
        if (oncoming & inside).any():
            waits[row] = True
        elif not (same & inside).any():
            nearer = (gap < gap[me]) | (gap == gap[me]) & (number < number[me])
            beyond = (position - mouth) @ way > 0  # a person that has come out does not enter
            first_of_mine = not (same & nearer & ~beyond).any()
            if not (first_of_mine and people.memory.waited[rows[row]] > HESITATES):
                waits[row] = bool((oncoming & beyond & nearer & (gap < CONTEST)).any())
        right = np.array([way[1], -way[0]])
        spots[row] = mouth - MOUTH * way + ASIDE * right
    return Turns(waits, spots)
