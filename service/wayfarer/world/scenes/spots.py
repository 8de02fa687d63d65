"""The spots where agents that share a goal stop: each has one, as near to the goal as possible.

An agent keeps its spot until another agent stands there, or a nearer one goes there, or the goal
becomes free before the agent has reached its spot. If the spot is too far from the goal, the agent
keeps looking for a nearer one.
"""

from collections.abc import Callable
from functools import cache
from math import pi, sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Motion, Slots
from wayfarer.world.goals.gait_rules import GoalArrays
from wayfarer.world.output.turns import apart
from wayfarer.world.rows import Array, Double, Flags, Float, Index, Int, columns
from wayfarer.world.scenes.people import Gathering
from wayfarer.world.scenes.world_scenes import Clear

NEAR: Final = 5.0
"""Metres from its goal within which an agent checks whether the goal is taken."""

APART: Final = 0.65
"""Metres between two agents that share a goal: nearer, their shoulders touch."""

STRANGERS: Final = 0.48
"""Metres to people with another goal: minus `SLACK` it is nearly the width of a body."""

SHARED: Final = 0.3
"""Metres within which two goals count as the same."""

SLACK: Final = 0.1
"""Metres of missing distance that are tolerated before another spot is taken."""

RADIUS: Final = 0.2
"""Metres from its spot within which an agent counts as being there."""

FARTHEST: Final = 2.0
"""Metres from its goal at which an agent that cannot get nearer still counts as arrived."""

WAITS: Final = 0.4
"""Metres from its spot within which an agent that is too far from its goal waits."""

KEEPS: Final = 0.1
"""Metres by which an agent must be nearer to a spot than another one to have it; within this
difference the lower number has it."""

WAY: Final = 0.35
"""Cost of a metre to walk, relative to that of a metre from the goal."""

TOO_FAR: Final = 10.0
"""Extra cost of a spot farther than `FARTHEST` from the goal."""

RINGS: Final = ((0.4, 8), (0.7, 12), (1.4, 18), (2.1, 24), (2.8, 30), (3.5, 36))
"""Metres from the goal, and the number of spots that are tried at this distance."""

SPOTS: Final = np.concatenate(
    [np.zeros((1, 2))]
    + [
        radius * np.stack([np.cos(turn), np.sin(turn)], -1)
        for radius, count in RINGS
        for turn in [2 * pi * np.arange(count) / count]
    ]
)
"""The spots [S, 2], in a frame in which the agent lies on the +x side of its goal."""

AROUND: Final = RINGS[-1][0] + APART
"""Metres from a goal beyond which people do not take its spots."""

ENOUGH: Final = sum(count for radius, count in RINGS if radius <= FARTHEST) + 1
"""Number of the first spots, which are near enough to a goal."""

_LINE: Final = np.linspace(0.0, 1.0, 8)[:, None]


class Claims(NamedTuple):
    """Claims around one goal [N]: where each person stands or goes, and the distance to keep."""

    places: Float  # [N, 2]
    apart: Double


class Everyone(NamedTuple):
    """All people [N]: columns of `People` and `Aims`, and the range of each one's session."""

    first: Index
    last: Index
    number: Int
    position: Float
    height: Float
    stand: Flags
    asked: Float
    spot: Float
    aside: Flags  # it makes way, and will return to its spot


class Walkers(NamedTuple):
    """Columns of all slots, and those of the rows [A] that are about to be stepped."""

    avoids: Flags
    places: Index  # by slot: its index in `Everyone`. The columns below are of rows
    asked: Float
    spot: Float
    barred: Float
    hips: Float  # [A, 2]
    arrived: Flags
    given: Flags
    position: Float  # [A, 3]
    radius: Float
    through: Flags


def take_spots(
    crowd: Gathering,
    slots: Slots,
    rows: Index,
    hips: Float,
    start: Motion,
    goals: GoalColumns,
    walls: Callable[[int], tuple[Clear, float]],
) -> Flags:
    """Chooses stops for those `rows` [A] that avoid others, and puts their `goals` there.

    Spots are chosen for agents that walk to a goal; an agent at its spot keeps it. `walls`: the
    walls of a slot's scene, and the metres that the slot keeps from them.
    Returns whether each row waits at a spot that is too far from the goal to count as arrived.
    """
    them, to, aims, count = crowd.people, crowd.people.aims, start.aims, len(crowd.stand)
    others = Everyone(
        *crowd.own,
        them.number,
        them.position,
        them.height,
        crowd.stand,
        to.asked,
        to.spot,
        them.memory.yields > 0,
    )
    claims, waits = (
        Claims(np.empty((count, 2), np.float32), np.empty(count)),
        np.zeros(len(rows), bool),
    )
    own = aims.asked, aims.spot, aims.barred, hips, start.gait.arrived
    of_goals = *columns(GoalArrays, goals)[:3], goals.through
    walkers = Walkers(slots.avoids, crowd.places, *own, *of_goals)
    row, known, keeps = next_taken(others, walkers, rows, 0, False, claims, waits)
    while row < len(rows):
        slot = int(rows[row])
        place, goal, spot = others.position[crowd.places[slot]], aims.asked[row], aims.spot[row]
        clear, room = walls(slot)
        some = claims.places[:known], claims.apart[:known]
        found = _free_spot(place, goal, *some, clear, room, spot)
        if not keeps or np.linalg.norm(found - goal) <= FARTHEST:
            aims.spot[row] = found
        row, known, keeps = next_taken(others, walkers, rows, row, True, claims, waits)
    return waits


@cache
def prepare() -> None:
    """Compiles its rules, or loads them, before agents walk."""
    one, flag, place = np.zeros(1, np.int64), np.ones(1, np.bool_), np.zeros((1, 2), np.float32)
    others = Everyone(one, one, one, place, place[0, :1], flag, place, place, flag)
    one_each = flag, one, place, place, place[0, :1], place, flag
    walkers = Walkers(*one_each, flag, np.zeros((1, 3), np.float32), place[0, :1], flag)
    warm(next_taken, others, walkers, one, 0, False, Claims(place, np.zeros(1)), flag)


@compiled
def next_taken(
    them: Everyone,
    those: Walkers,
    rows: Index,
    begin: int,
    found: bool,
    claims: Claims,
    waits: Flags,
) -> tuple[int, int, bool]:
    """The first row, at or after `begin`, whose spot is taken or too far from its goal, or A; the
    number of claims around its goal, and whether it keeps its spot if no other is near enough.

    The claims are written to `claims`, and the goals of the rows before it are put at their spots.
    The spot of an agent far from its goal is the goal. `found`: a spot has been looked for already
    for row `begin`.
    """
    for row in range(begin, len(rows)):
        slot = rows[row]
        me, goes = those.places[slot], those.given[row] and not those.arrived[row]
        if not those.avoids[slot]:
            continue
        if not (found and row == begin):
            if not goes:
                those.barred[row] = 0.0
            if them.last[me] - them.first[me] < 2:
                continue
            x, y = those.position[row, 0], those.position[row, 1]
            if those.asked[row, 0] != x or those.asked[row, 1] != y:
                those.asked[row, 0], those.asked[row, 1] = x, y
                those.spot[row, 0], those.spot[row, 1] = x, y
            if goes and not those.through[row]:
                count, taken = _claimed(them, those, me, row, claims)
                if count >= 0:
                    return row, count, not taken
        x, y = those.spot[row, 0], those.spot[row, 1]
        moved = those.asked[row, 0] != x or those.asked[row, 1] != y
        if moved and those.given[row] and not those.through[row]:
            those.position[row, 0], those.position[row, 1] = x, y
            those.radius[row] = min(those.radius[row], np.float32(RADIUS))
            if apart(those.spot, row, those.asked, row) > FARTHEST:
                waits[row] = apart(those.spot, row, those.hips, row) < WAITS
                those.given[row] = not waits[row]
                those.radius[row] = -1.0
    return len(rows), 0, False


@inner
def _claimed(them: Everyone, those: Walkers, me: int, row: int, claims: Claims) -> tuple[int, bool]:
    """The number of claims around a person's goal if the person's spot is taken or too far from
    the goal and a nearer one may be free, otherwise -1; and whether the spot is taken.
    """
    taken, free, empty, count, spot, asked = False, True, True, 0, those.spot, those.asked
    mine = apart(them.position, me, spot, row)
    near = apart(them.position, me, asked, row) <= NEAR
    for other in range(them.first[me], them.last[me] if near else them.first[me]):
        stands = them.stand[other]
        if other == me:
            continue
        if abs(them.height[other] - them.height[me]) >= 1.0:
            continue
        # an agent that has arrived and still walks claims its spot, too
        claim = them.position if stands else them.spot
        if apart(claim, other, asked, row) >= AROUND:
            continue
        share = apart(them.asked, other, asked, row) < SHARED
        claims.places[count, 0], claims.places[count, 1] = claim[other, 0], claim[other, 1]
        claims.apart[count] = APART if share else STRANGERS
        theirs = apart(claim, other, them.position, other)
        before = theirs < mine - KEEPS or (
            theirs <= mine + KEEPS and them.number[other] < them.number[me]
        )
        away = apart(claim, other, asked, row)
        free = free and away >= claims.apart[count]
        if them.aside[other]:
            away = min(away, apart(them.spot, other, asked, row))
        empty = empty and away >= APART and not share
        gap = apart(claim, other, spot, row) - claims.apart[count]
        taken = taken or ((stands or before) and gap < -SLACK)
        count += 1
    # an agent at its spot has settled, until nobody is at its goal
    if not near or empty or (free and mine > RADIUS):
        spot[row, 0], spot[row, 1] = asked[row, 0], asked[row, 1]
        return -1, False
    taken = taken and mine > SLACK  # an agent that gets no nearer stops where it is
    looks_on = apart(spot, row, asked, row) > FARTHEST and _is_room(
        them, those, me, row, claims, count
    )
    return count if taken or looks_on else -1, taken


@inner
def _is_room(them: Everyone, those: Walkers, me: int, row: int, claims: Claims, count: int) -> bool:
    """Whether one of the spots near enough to a person's goal may be free: in a throng no search
    would find one. It is exact to a millimetre, and does not look at walls, as the search does.
    """
    goal_x, goal_y = those.asked[row, 0], those.asked[row, 1]
    x, y = them.position[me, 0] - goal_x, them.position[me, 1] - goal_y
    length = sqrt(x * x + y * y)
    x, y = (x / length, y / length) if length > 1e-3 else (1.0, 0.0)
    for spot in range(ENOUGH):
        ahead, left, free = SPOTS[spot, 0], SPOTS[spot, 1], True
        spot_x, spot_y = goal_x + ahead * x - left * y, goal_y + ahead * y + left * x
        for k in range(count):
            off_x, off_y = spot_x - claims.places[k, 0], spot_y - claims.places[k, 1]
            if sqrt(off_x * off_x + off_y * off_y) < claims.apart[k] - 1e-3:
                free = False
                break
        if free:
            return True
    return False


def _free_spot(
    place: Array, goal: Array, taken: Array, by: Array, clear: Clear, room: float, last: Array
) -> Array:
    """The best spot [2] for an agent at `place`, at least `by` [N] metres from places `taken`
    [N, 2]; `last` if none is free.
    """
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
    # of equal costs, the first is taken: rounding must not choose
    return spots[int((cost <= cost.min() + 1e-4).argmax())].astype(np.float32)
