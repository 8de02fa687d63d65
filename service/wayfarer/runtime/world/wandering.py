"""Places to wander to: drawn from the agent's seed and counters alone, so a run can be repeated."""

from math import cos, dist, pi, sin, sqrt
from typing import Final

import numpy as np

from wayfarer.runtime.agent import Goal, Wander

APART: Final = 1.0
"""Metres: the next place is at least so far away, where the area allows it."""

TRIES: Final = 16
"""Draws until the farthest place of the area is taken instead."""

_STREAM = 0x5741595741594652  # second half of the key: keeps these draws apart from others'


def wander_goal(
    area: Wander, seed: int, revision: int, waypoint: int, start: tuple[float, float]
) -> Goal:
    """Goal number `waypoint` of an agent who wanders, to be walked to from `start`.

    Uniform in the disc, but for the places too near.
    """
    key = np.array([seed, _STREAM], np.uint64)
    counter = np.array([0, waypoint, revision, 0], np.uint64)
    draws = np.random.Generator(np.random.Philox(key=key, counter=counter)).random((TRIES, 2))
    x, y = area.center
    for share, turn in draws.tolist():
        way = area.radius * sqrt(share)
        place = (x + way * cos(2 * pi * turn), y + way * sin(2 * pi * turn))
        if dist(place, start) >= APART:
            return _goal(area, place)
    away = max(dist(start, area.center), 1e-6)
    share = area.radius / away
    return _goal(area, (x + (x - start[0]) * share, y + (y - start[1]) * share))


def _goal(area: Wander, place: tuple[float, float]) -> Goal:
    return Goal((*place, 0.0), speed=area.speed, dwell=area.dwell)
