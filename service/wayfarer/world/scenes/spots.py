"""Where agents stop that share a goal: each at a spot of its own, as near to it as others let it.

An agent keeps its spot until somebody stands there, or somebody goes there who is nearer to it, or
the goal becomes free before it has got to its spot.
"""

from collections.abc import Callable
from functools import cache
from math import pi
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.compiled import compiled, warm
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.avoidance.people import Aims
from wayfarer.world.output.turns import apart
from wayfarer.world.rows import Double, Flags, Float, Index, Int
from wayfarer.world.scenes.people import Gathering

Array = NDArray[np.floating[Any]]

NEAR: Final = 5.0
"""Metres from its goal within which an agent looks whether it is taken."""

APART: Final = 0.65
"""Metres between two who share a goal: nearer their shoulders touch."""

STRANGERS: Final = 0.4
"""Metres to somebody with another goal: agents may be sent as near as bodies are wide."""

SHARED: Final = 0.3
"""Metres between two goals that are one."""

SLACK: Final = 0.1
"""Metres that may be missing until another spot is taken."""

RADIUS: Final = 0.2
"""Metres from its spot within which an agent is there."""

FARTHEST: Final = 2.0
"""Metres from its goal at which an agent that cannot get nearer still counts as arrived."""

KEEPS: Final = 0.1
"""Metres by which another one must be nearer to a spot to take it from whoever goes there."""

WAY: Final = 0.35
"""Cost of a metre to walk, beside that of one from the goal."""

TOO_FAR: Final = 10.0
"""Cost of a spot that does not count as arrived."""

RINGS: Final = ((0.4, 8), (0.7, 12), (1.4, 18), (2.1, 24), (2.8, 30), (3.5, 36))
"""Metres from the goal, and spots that are tried there."""

SPOTS: Final = np.concatenate(
    [np.zeros((1, 2))]
    + [
        radius * np.stack([np.cos(turn), np.sin(turn)], -1)
        for radius, count in RINGS
        for turn in [2 * pi * np.arange(count) / count]
    ]
)
"""They [S, 2], in a frame in which the agent lies on the +x side of its goal."""

AROUND: Final = RINGS[-1][0] + APART
"""Metres from a goal beyond which nobody takes one of its spots."""

_LINE: Final = np.linspace(0.0, 1.0, 8)[:, None]

Clear = Callable[[Array], Array]
"""Metres to the nearest wall [P] at points [P, 2] on the agent's storey."""


class Claims(NamedTuple):
    """Those around one goal [N]: where each stands, or goes, and how far one keeps from there."""

    places: Float  # [N, 2]
    apart: Double


class Everyone(NamedTuple):
    """Everybody [N]: columns of `People` and `Aims`, and where everybody's session is in them."""

    first: Index
    last: Index
    number: Int
    position: Float
    height: Float
    walks: Flags
    stand: Flags
    wants: Flags
    asked: Float
    spot: Float


def take_spots(
    crowd: Gathering,
    people: Index,
    goals: GoalColumns,
    aims: Aims,
    concerned: Flags,
    walls: Callable[[int], tuple[Clear, float]],
) -> Flags:
    """Choose where the agents stop that are the rows `people` [A] of a crowd.

    `goals` and `aims` are theirs: spots are chosen for those `concerned` [A], which walk to a
    goal, and written into both; those at their spots keep them. `walls`: of the scene of one of
    them, and the metres that it keeps from them there.
    Returns rows whose spot is farther from the goal than counts as arrived.
    """
    kept = (aims.asked == goals.position[:, :2]).all(-1)
    aims.asked[:] = goals.position[:, :2]
    aims.spot[~kept] = aims.asked[~kept]
    others, count = _everyone(crowd), len(crowd.stand)
    claims = Claims(np.empty((count, 2), np.float32), np.empty(count))
    row, known = next_taken(others, people, concerned, aims.asked, aims.spot, 0, claims)
    while row < len(people):
        place, goal, spot = others.position[people[row]], aims.asked[row], aims.spot[row]
        clear, room = walls(row)
        some = claims.places[:known], claims.apart[:known]
        aims.spot[row] = _free_spot(place, goal, *some, clear, room, spot)
        row, known = next_taken(others, people, concerned, aims.asked, aims.spot, row + 1, claims)
    moved = (aims.spot != aims.asked).any(-1) & goals.given & ~goals.through
    goals.position[moved, :2] = aims.spot[moved]
    goals.radius[moved] = np.minimum(goals.radius[moved], RADIUS)
    far: Flags = moved & (np.linalg.norm(aims.spot - aims.asked, axis=-1) > FARTHEST)
    return far


@cache
def prepare() -> None:
    """Compile what is compiled of it, or load it, before anybody walks."""
    one, flags, place = np.zeros(1, np.int64), np.ones(1, np.bool_), np.zeros((1, 2), np.float32)
    others = Everyone(one, one, one, place, place[0, :1], flags, flags, flags, place, place)
    warm(next_taken, others, one, flags, place, place, 0, Claims(place, np.zeros(1)))


def _everyone(crowd: Gathering) -> Everyone:
    them, aims = crowd.people, crowd.people.aims
    return Everyone(
        *crowd.own,
        them.number,
        them.position,
        them.height,
        them.walks,
        crowd.stand,
        aims.wants,
        aims.asked,
        aims.spot,
    )


@compiled
def next_taken(
    them: Everyone,
    people: Index,
    concerned: Flags,
    asked: Float,
    spot: Float,
    begin: int,
    claims: Claims,
) -> tuple[int, int]:
    """The first of rows `begin` to A whose spot is taken, or A; and how many claims it has met,
    which are then in `claims`. Who is far from its goal gets that as its spot.
    """
    for row in range(begin, len(people)):
        me, taken, free, count = people[row], False, True, 0
        if not concerned[row]:
            continue
        if apart(them.position, me, asked, row) > NEAR:
            spot[row] = asked[row]
            continue
        mine = apart(them.position, me, spot, row)
        for other in range(them.first[me], them.last[me]):
            stands = them.stand[other]
            if other == me or not (stands or (them.walks[other] and them.wants[other])):
                continue
            if abs(them.height[other] - them.height[me]) >= 1.0:
                continue
            claim = them.position if stands else them.spot
            if apart(claim, other, asked, row) >= AROUND:
                continue
            share = apart(them.asked, other, asked, row) < SHARED
            claims.places[count] = claim[other]
            claims.apart[count] = APART if share else STRANGERS
            theirs = apart(claim, other, them.position, other)
            before = theirs < mine - KEEPS or (
                theirs <= mine + KEEPS and them.number[other] < them.number[me]
            )
            free = free and apart(claim, other, asked, row) >= claims.apart[count]
            gap = apart(claim, other, spot, row) - claims.apart[count]
            taken = taken or ((stands or before) and gap < -SLACK)
            count += 1
        if free and mine > RADIUS:  # who stays where it is has settled
            spot[row] = asked[row]
        elif taken:
            return row, count
    return len(people), 0


def _free_spot(
    place: Array, goal: Array, taken: Array, by: Array, clear: Clear, room: float, last: Array
) -> Array:
    """The best place [2] for one at `place`, apart by [N] from those `taken` [N, 2]; or `last`."""
    way = place - goal
    length = float(np.linalg.norm(way))
    x, y = way / length if length > 1e-3 else np.array([1.0, 0.0])
    spots = goal + SPOTS @ np.array([[x, y], [-y, x]])
    free = (np.linalg.norm(spots[:, None] - taken, axis=-1) >= by).all(1)
    lines = goal + _LINE[None] * (spots - goal)[:, None]
    near = clear(lines.reshape(-1, 2)).reshape(len(spots), -1)
    free &= (near[:, -1] >= room) & (near.min(1) > 0)
    off = np.linalg.norm(spots - goal, axis=-1)
    cost = off + WAY * np.linalg.norm(spots - place, axis=-1) + TOO_FAR * (off > FARTHEST)
    cost = np.where(free, cost, np.inf)
    if not free.any():
        return last
    # of those that cost as much the first is taken: rounding must not choose
    return spots[int((cost <= cost.min() + 1e-4).argmax())].astype(np.float32)
