"""Narrow ways: how wide they are, where two keep apart in them, and how they turn their shoulders.

A way that is narrow for a metre has two lanes; a door has none. An agent that meets somebody there
keeps to the right lane. Where both do not fit with their shoulders across, each turns the left
shoulder forward, and so its back to the other: a body drifts to where it faces, and that is away.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.world.avoidance.people import People
from wayfarer.world.rows import Flags, Index

Array = NDArray[np.floating[Any]]

ACROSS: Final = np.arange(-1.2, 1.21, 0.1)
"""Metres to the right of a way at which walls are looked for."""

LANES: Final = 0.9
"""Half of a way's width within which it has lanes: in wider ones avoidance finds its own."""

LANE: Final = 0.4
"""Share of the half width by which a lane is off the middle."""

STEERS: Final = 2.0
"""Metres farther aside that it heads for, for each metre by which it is off its lane."""

REACTION: Final = 0.35
"""Seconds until a body follows."""

DRIFT: Final = 0.5
"""Metres that it heads to the other side for a radian of its turn: a body goes where it faces."""

SEES: Final = 7.0
"""Metres: an agent keeps to its lane while an oncoming one is less far ahead."""

PAST: Final = -0.3
"""Metres: an agent keeps to its lane until the other is this far behind."""

AGAINST: Final = 0.5
"""Cosine from which two go against each other."""

TURNS: Final = (0.46, 0.66)
TURN: Final = np.radians(40.0)
"""Half widths between which two who pass turn their shoulders, and by how much in the narrowest."""

SQUEEZE: Final = (0.23, 0.29)
"""The same for one alone."""

TURN_SECONDS: Final = 1.4
"""Seconds before two pass from which they turn."""

SIDEWAYS: Final = 0.9
"""m/s at most with turned shoulders."""


class Lane(NamedTuple):
    """The demands of narrow ways on some people [A]."""

    half: Array  # metres: half of the way's width where it is widest in the next metre
    keeps: Flags  # walks in its lane
    place: Array  # [A, 2] where that leads
    turn: Array  # radians to the right of the way that it faces; 0: it does not turn
    way: Array  # [A, 2] unit vector


def lanes(
    people: People,
    rows: Index,
    points: Array,
    distance: Callable[[Array], Array],
) -> Lane:
    """Lanes of the people at `rows`.

    `points` [A, S, 2]: their ways in the next metres; the last one is headed for. `distance`:
    metres to the nearest wall at points [A, P, 2] of these rows, [A, P].
    """
    place = people.position[rows]
    way = points[:, -1] - points[:, 0]
    way = way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
    right = np.stack([way[:, 1], -way[:, 0]], -1)
    low, high = _walls(points, right, distance)
    halves = (high - low) / 2
    half = halves.max(1)
    apart = people.position - place[:, None]
    ahead, aside = (apart * way[:, None]).sum(-1), (apart * right[:, None]).sum(-1)
    wish = people.memory.preferred
    speed = np.maximum(np.linalg.norm(wish, axis=-1), 1e-6)
    comes = people.walks & ((way @ wish.T) / speed < -AGAINST)
    comes &= (ahead > PAST) & (ahead < SEES) & (np.abs(aside) < 2 * LANES)
    comes &= np.abs(people.height - people.height[rows, None]) < 1.0
    keeps = (half < LANES) & comes.any(1)
    middle = (high[:, -1] + low[:, -1]) / 2
    wanted = middle + LANE * (high - low)[:, -1] / 2
    soon = place + REACTION * people.velocity[rows]
    off = wanted - ((soon - points[:, -1]) * right).sum(-1)
    closing = ((people.velocity[rows, None] - people.velocity) * way[:, None]).sum(-1)
    passes = comes & (ahead < np.maximum(closing, 0.5) * TURN_SECONDS)
    turn = np.where(passes.any(1), np.interp(half, TURNS, (TURN, 0.0)), 0.0)
    turn = np.maximum(turn, np.interp(halves.min(1), SQUEEZE, (TURN, 0.0)))
    aim = wanted + STEERS * off - DRIFT * turn
    lane = points[:, -1] + aim[:, None] * right
    return Lane(half, keeps, lane, turn, way)


def _walls(points: Array, right: Array, distance: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Metres to the right of points [A, S, 2] at which the walls beside them are: [A, S] each."""
    grid = points[:, :, None] + ACROSS[:, None] * right[:, None, None]
    room = distance(grid.reshape(len(points), -1, 2)).reshape(*points.shape[:2], len(ACROSS))
    free, middle = room > 0.0, len(ACROSS) // 2
    after = np.logical_and.accumulate(free[..., middle:], -1)
    before = np.logical_and.accumulate(free[..., middle::-1], -1)
    high = np.where(after, ACROSS[middle:] + room[..., middle:], 0).max(-1)
    low = np.where(before, ACROSS[middle::-1] - room[..., middle::-1], 0).min(-1)
    return low, high
