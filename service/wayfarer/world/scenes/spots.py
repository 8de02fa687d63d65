"""Where agents stop that share a goal: each at a spot of its own, as near to it as others let it.

An agent keeps its spot until somebody stands there, or somebody goes there who is nearer to it.
"""

from collections.abc import Callable, Sequence
from math import pi
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.avoidance.people import Aims
from wayfarer.world.rows import Flags, Index
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


def take_spots(
    everybody: SessionPeople,
    people: Index,
    goals: GoalColumns,
    aims: Aims,
    concerned: Flags,
    clear: Sequence[Clear],
    room: float,
) -> Flags:
    """Choose where the agents stop that are the rows `people` of a session.

    `goals` and `aims` are theirs: spots are chosen for those `concerned` [A], which walk to a
    goal, and written into both; those at their spots keep them. `clear` [A]: of their scenes;
    `room`: metres that it keeps from walls there.
    Returns rows whose spot is farther from the goal than counts as arrived.
    """
    kept = (aims.asked == goals.position[:, :2]).all(-1)
    aims.asked[:] = goals.position[:, :2]
    aims.spot[~kept] = aims.asked[~kept]
    standing, them = everybody.stand, everybody.people
    # claims of everybody: where it stands, or where it goes
    claims = np.where(standing[:, None], them.position, them.aims.spot)
    apart = np.linalg.norm(claims - them.position, axis=-1)
    counts = standing | (them.walks & them.aims.wants)
    for row in np.flatnonzero(concerned).tolist():
        me = int(people[row])
        place, goal, spot = them.position[me], aims.asked[row], aims.spot[row]
        if np.linalg.norm(goal - place) > NEAR:
            aims.spot[row] = goal
            continue
        others = counts & (np.abs(them.height - them.height[me]) < 1.0)
        others[me] = False
        others &= np.linalg.norm(claims - goal, axis=-1) < RINGS[-1][0] + APART
        mine = float(np.linalg.norm(spot - place))
        first = apart < mine - KEEPS
        first |= (apart <= mine + KEEPS) & (them.number < them.number[me])
        share = np.linalg.norm(them.aims.asked - goal, axis=-1) < SHARED
        apart_by = np.where(share, APART, STRANGERS)
        taken = others & (standing | first)
        gaps = np.linalg.norm(claims - spot, axis=-1) - apart_by
        if (gaps[taken] < -SLACK).any():
            some = claims[others], apart_by[others]
            aims.spot[row] = _free_spot(place, goal, *some, clear[row], room, spot)
    moved = (aims.spot != aims.asked).any(-1) & goals.given & ~goals.through
    goals.position[moved, :2] = aims.spot[moved]
    goals.radius[moved] = np.minimum(goals.radius[moved], RADIUS)
    far: Flags = moved & (np.linalg.norm(aims.spot - aims.asked, axis=-1) > FARTHEST)
    return far


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
