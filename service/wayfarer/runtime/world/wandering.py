"""Places to wander to: drawn from the agent's seed and counters alone, so a run can be repeated."""

from math import cos, dist, pi, sin, sqrt
from typing import Final

import numpy as np

from wayfarer.navigation.scene import Scene
from wayfarer.runtime.agent import Goal
from wayfarer.runtime.behaviours import Wander
from wayfarer.runtime.scenes.places import drawn_places, island_at

APART: Final = 1.0
"""Metres: the next place of an area is at least so far away, where the area allows it."""

FARTHER: Final = 5.0
"""Metres: the same all over a scene."""

TRIES: Final = 16
"""Draws until the farthest place of the area, or of those drawn, is taken instead."""

_STREAM = 0x5741595741594652  # second half of the key: keeps these draws apart from others'


def wander_goal(
    area: Wander,
    seed: int,
    revision: int,
    waypoint: int,
    start: tuple[float, float],
    scene: Scene | None = None,
    height: float = 0.0,
) -> Goal:
    """Goal number `waypoint` of an agent who wanders, to be walked to from `start`.

    Uniform in the disc, or in that part of the scene which can be reached; but for the places too
    near. `height` says which storey the agent is on.
    """
    key = np.array([seed, _STREAM], np.uint64)
    counter = np.array([0, waypoint, revision, 0], np.uint64)
    random = np.random.Generator(np.random.Philox(key=key, counter=counter))
    if area.center is None:
        assert scene is not None  # checked with the order
        return _all_over(area, scene, random.random((TRIES, 3)), (*start, height))
    x, y = area.center
    for share, turn in random.random((TRIES, 2)).tolist():
        way = area.radius * sqrt(share)
        place = (x + way * cos(2 * pi * turn), y + way * sin(2 * pi * turn))
        if dist(place, start) >= APART:
            return _goal(area, (*place, height))
    away = max(dist(start, area.center), 1e-6)
    share = area.radius / away
    return _goal(area, (x + (x - start[0]) * share, y + (y - start[1]) * share, height))


def _all_over(
    area: Wander, scene: Scene, draws: np.ndarray, start: tuple[float, float, float]
) -> Goal:
    places = drawn_places(scene, island_at(scene, start), draws)
    apart = np.linalg.norm(places[:, :2] - start[:2], axis=1)
    far = np.flatnonzero(apart >= FARTHER)
    x, y, z = places[far[0] if len(far) else apart.argmax()].tolist()
    return _goal(area, (x, y, z))


def _goal(area: Wander, place: tuple[float, float, float]) -> Goal:
    return Goal(place, speed=area.speed, dwell=area.dwell)
