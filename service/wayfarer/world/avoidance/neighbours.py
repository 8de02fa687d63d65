"""The neighbours that each person avoids: the few that matter soonest."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfarer.world.avoidance.people import Float, People
from wayfarer.world.avoidance.rules import Rules
from wayfarer.world.rows import Index


@dataclass(frozen=True, slots=True)
class Neighbours:
    """Neighbours [A, K] of each person asked, relative to it; `nobody` fills up, far away."""

    index: Index  # rows of `People`
    nobody: NDArray[np.bool_]
    dx: Float  # metres to it
    dy: Float
    distance: Float


def neighbours(people: People, rows: Index, rules: Rules) -> Neighbours:
    """Those in sight who are near now, or will be in a second.

    All against all: for a few rows and some hundred people that is cheaper than a tree.
    """
    place, velocity = people.position, people.velocity
    dx = place[:, 0] - place[rows, 0, None]
    dy = place[:, 1] - place[rows, 1, None]
    soon_x = dx + velocity[:, 0] - velocity[rows, 0, None]
    soon_y = dy + velocity[:, 1] - velocity[rows, 1, None]
    square = dx * dx + dy * dy
    urgency = np.sqrt(square) + np.sqrt(soon_x * soon_x + soon_y * soon_y)
    far = square > rules.sight * rules.sight
    far[np.arange(len(rows)), rows] = True
    urgency[far] = np.inf
    count = min(rules.neighbours, len(place))
    # sorted, so that the choice does not depend on how numpy partitions
    index = np.argsort(urgency, axis=1, kind="stable")[:, :count]
    pick = np.arange(len(rows))[:, None], index
    return Neighbours(index, far[pick], dx[pick], dy[pick], np.sqrt(square[pick]))
