"""Where agents stop that share a goal: each at a spot of its own, as near to it as others let it.

An agent keeps its spot until somebody stands there, or somebody goes there who is nearer to it.
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
from wayfarer.world.scenes.people import SessionPeople

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

FAR: Final = RINGS[-1][0] + APART
"""Metres from the goal beyond which others do not count."""

SPOTS: Final = np.concatenate(
    [np.zeros((1, 2))]
    + [
        radius * np.stack([np.cos(turn), np.sin(turn)], -1)
        for radius, count in RINGS
        for turn in [2 * pi * np.arange(count) / count]
    ]
)
"""They [S, 2], in a frame in which the agent lies on the +x side of its goal."""

_LINE: Final = np.linspace(0.0, 1.0, 8)[:, None]

Clear = Callable[[Array], Array]
"""Metres to the nearest wall [P] at points [P, 2] on the agent's storey."""


class Seekers(NamedTuple):
    """Some agents [A] of a session, and where each is to stop."""

    rows: Index  # of the session's people
    asked: Float  # [A, 2] their goals …
    spot: Float  # [A, 2] … and spots: new ones are written there
    concerned: Flags  # it walks to its goal; who is at its spot keeps it


def take_spots(
    everybody: SessionPeople, seekers: Seekers, clear: Callable[[int], Clear], room: float
) -> None:
    """Choose where agents stop. `clear(row)`: of a seeker's scene; `room`: metres that it keeps
    from walls there.
    """
    people, shape = everybody.people, (len(seekers.rows), len(everybody.slots))
    claims = np.where(everybody.stand[:, None], people.position, people.aims.spot)
    session = Claimants(
        people.number, people.position, people.height, people.aims.asked, claims,
        everybody.stand, everybody.stand | (people.walks & people.aims.wants),
    )  # fmt: skip
    by = np.full(shape, -1, np.float64)
    lost = np.zeros(len(seekers.rows), np.bool_)
    _look_at_spots(session, seekers, by, lost)
    for row in np.flatnonzero(lost).tolist():
        others = by[row] >= 0
        taken = claims[others], by[row][others]
        place, goal = people.position[seekers.rows[row]], seekers.asked[row]
        seekers.spot[row] = _free_spot(place, goal, *taken, clear(row), room, seekers.spot[row])


class Claimants(NamedTuple):
    """Everybody [N] of a session, for compiled rules."""

    number: Int
    position: Float
    height: Float
    asked: Float
    claims: Float  # [N, 2] where it stands, or where it goes
    stand: Flags
    counts: Flags  # it stands or goes


@compiled
def _look_at_spots(session: Claimants, seekers: Seekers, by: Double, lost: Flags) -> None:
    """Whose spot is taken is `lost` [A]: then metres that it keeps from others are `by` [A, N].

    Who is far from its goal takes that for its spot.
    """
    claims, spot = session.claims, seekers.spot
    for row in range(len(lost)):
        me = seekers.rows[row]
        if not seekers.concerned[row]:
            continue
        if apart(seekers.asked, row, session.position, me) > NEAR:
            spot[row, 0], spot[row, 1] = seekers.asked[row, 0], seekers.asked[row, 1]
            continue
        mine = apart(spot, row, session.position, me)
        for other in range(len(claims)):
            level = abs(session.height[other] - session.height[me]) < 1.0
            if other == me or not session.counts[other] or not level:
                continue
            if apart(claims, other, seekers.asked, row) >= FAR:
                continue
            shares = apart(session.asked, other, seekers.asked, row) < SHARED
            by[row, other] = APART if shares else STRANGERS
            way, lower = apart(claims, other, session.position, other), session.number[me]
            first = way < mine - KEEPS
            first = first or (way <= mine + KEEPS and session.number[other] < lower)
            if session.stand[other] or first:
                gap = apart(claims, other, spot, row) - by[row, other]
                lost[row] = lost[row] or gap < -SLACK


def set_spots(goals: GoalColumns, aims: Aims) -> Flags:
    """Let goals [A] be at spots; those whose spots are farther away than counts as arrived."""
    moved = (aims.spot != aims.asked).any(-1) & goals.given & ~goals.through
    goals.position[moved, :2] = aims.spot[moved]
    goals.radius[moved] = np.minimum(goals.radius[moved], RADIUS)
    far: Flags = moved & (np.linalg.norm(aims.spot - aims.asked, axis=-1) > FARTHEST)
    return far


@cache
def prepare() -> None:
    """Compile the rule, or load it, before anybody walks."""
    place, number, flag = np.zeros((1, 2), np.float32), np.zeros(1, np.int64), np.ones(1, np.bool_)
    session = Claimants(number, place, np.zeros(1, np.float32), place, place, flag, flag)
    seekers = Seekers(number, place, place, flag)
    warm(_look_at_spots, session, seekers, np.zeros((1, 1)), np.zeros(1, np.bool_))


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
