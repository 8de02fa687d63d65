"""Who is near whom, and the few neighbours that each person avoids: those that matter soonest."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfarer.world.avoidance.people import Float, People
from wayfarer.world.avoidance.rules import Rules
from wayfarer.world.rows import Index


@dataclass(frozen=True, slots=True)
class Pairs:
    """Persons [P] near those who are asked, ordered by who asks and then by row of `People`."""

    asking: Index  # places among those asked
    other: Index  # rows of `People`
    dx: Float  # metres from the one to the other
    dy: Float


def near_pairs(people: People, rows: Index, rules: Rules) -> Pairs:
    """All pairs of people at `rows` and others on their storey within `rules.reach`.

    Distances are taken of all against all: for a few rows and a thousand people that is cheaper
    than a grid or a tree. Whatever costs more is done for these pairs only.
    """
    x, y = people.position.T.copy()
    dx, dy = x - x[rows, None], y - y[rows, None]
    square = dx * dx
    square += dy * dy
    near = square <= rules.reach * rules.reach
    near &= np.abs(people.height - people.height[rows, None]) < rules.storey
    near[np.arange(len(rows)), rows] = False
    at = np.flatnonzero(near)
    asking, other = np.divmod(at, len(x))
    return Pairs(asking, other, dx.ravel()[at], dy.ravel()[at])


@dataclass(frozen=True, slots=True)
class Neighbours:
    """Neighbours [A, K] of each person asked, relative to it; `nobody` fills up."""

    index: Index  # rows of `People`
    nobody: NDArray[np.bool_]
    dx: Float  # metres to it
    dy: Float
    distance: Float


def neighbours(people: People, rows: Index, pairs: Pairs, rules: Rules) -> Neighbours:
    """Those of the pairs in sight who are near now, or will be in a second; the nearest first."""
    velocity = people.velocity
    square = pairs.dx * pairs.dx + pairs.dy * pairs.dy
    seen = square <= rules.sight * rules.sight
    asking, other, dx, dy = pairs.asking[seen], pairs.other[seen], pairs.dx[seen], pairs.dy[seen]
    distance, relative = np.sqrt(square[seen]), velocity[other] - velocity[rows[asking]]
    soon_x, soon_y = dx + relative[:, 0], dy + relative[:, 1]
    urgency = distance + np.sqrt(soon_x * soon_x + soon_y * soon_y)
    first = np.lexsort((urgency, asking))  # stable: of two alike the lower row is the first
    asking = asking[first]
    begin = np.searchsorted(asking, np.arange(len(rows)))
    rank = np.arange(len(asking)) - begin[asking]
    first, asking, rank = (column[rank < rules.neighbours] for column in (first, asking, rank))
    size = (len(rows), rules.neighbours)
    found = Neighbours(
        np.repeat(rows[:, None], rules.neighbours, 1),
        np.ones(size, bool),
        *(np.zeros(size, np.float32) for _ in range(3)),
    )
    at = asking, rank
    found.index[at], found.nobody[at] = other[first], False
    found.dx[at], found.dy[at], found.distance[at] = dx[first], dy[first], distance[first]
    return found
