"""Wandering: from one random place to another.

Places are drawn from the agent's seed and counters alone, so a run can be repeated.
"""

from dataclasses import dataclass
from math import cos, dist, pi, sin, sqrt
from typing import Annotated, ClassVar, Final, Literal

import numpy as np

from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument, Metres, MetresPerSecond
from wayfarer.navigation.scene import Scene
from wayfarer.spec import MAX_COORDINATE
from wayfarer.world.agents.behaviour import BehavingAgent, Behaviour, Start
from wayfarer.world.agents.goal import DWELL, SPEED, Goal
from wayfarer.world.behaviours.places import drawn_places, island_at
from wayfarer.world.ranges import check_place, check_range

APART: Final = 1.0
"""Minimum metres to the next place of an area, if the area allows it."""

FARTHER: Final = 5.0
"""Minimum metres to the next place when it wanders all over a scene."""

TRIES: Final = 16
"""Draws after which the farthest place of the area, or of those drawn, is taken instead."""

_STREAM = 0x5741595741594652  # second half of the key: separates these draws from others

MIN_RADIUS: Final = 0.5
"""Minimum radius in metres."""


@dataclass(frozen=True, slots=True)
class Wander(Behaviour):
    """Walking about in a disc, or all over the scene, from one random place to another.

    Places are drawn from the agent's seed, its revision and their number in the path.
    """

    center: tuple[float, float] | None  # metres, world; None: all free ground of the agent's scene
    radius: Annotated[float, (MIN_RADIUS, None)] = 0.0  # metres; ignored without a centre
    speed: Annotated[float, SPEED] = 1.2  # m/s
    dwell: Annotated[float, DWELL] = 0.0  # seconds to stand at each place
    kind: Literal["wander"] = "wander"

    WALKS: ClassVar[bool] = True
    FROM_PLACE_TO_PLACE: ClassVar[bool] = True

    @property
    def needs_scene(self) -> bool:
        """Implements `Behaviour`."""
        return self.center is None

    def check(self, start: Start, limits: Limits, where: str) -> None:
        """Implements `Behaviour`."""
        if self.center is not None:
            _check_disc(self.center, self.radius, start or self.center, limits, where)
        check_range([self.speed], *SPEED, f"{where}.speed", MetresPerSecond)
        check_range([self.dwell], *DWELL, f"{where}.dwell")

    def next_goal(self, actor: BehavingAgent, number: int) -> Goal:
        """Implements `Behaviour`."""
        agent = actor.agent
        start = agent.path[-1].position[:2] if agent.path else agent.path_start
        seed, revision = agent.spec.noise_seed, actor.revision
        return wander_goal(self, seed, revision, number, start, actor.scene, actor.height)


def _check_disc(
    center: tuple[float, float],
    radius: float,
    start: tuple[float, ...],
    limits: Limits,
    where: str,
) -> None:
    check_place(center, f"{where}.center")
    check_range([radius], MIN_RADIUS, limits.goal_distance_m, f"{where}.radius", Metres)
    farthest = dist(center, start[:2]) + radius
    if farthest > limits.goal_distance_m:
        raise InvalidArgument(
            "the area reaches as far as {} from the agent; allowed: at most {}",
            f"{where}.center",
            Metres(round(farthest)),
            Metres(limits.goal_distance_m),
        )
    reach = max(map(abs, center)) + radius
    if reach > MAX_COORDINATE:
        raise InvalidArgument(
            "the area reaches as far as {} along an axis; allowed: {}",
            f"{where}.center",
            Metres(round(reach)),
            Metres(MAX_COORDINATE),
        )


def wander_goal(
    area: Wander,
    seed: int,
    revision: int,
    waypoint: int,
    start: tuple[float, float],
    scene: Scene | None = None,
    height: float = 0.0,
) -> Goal:
    """Goal number `waypoint` of a wandering agent, which walks there from `start`.

    It is uniform in the disc, or in the reachable part of the scene, except places too near.
    `height` identifies the agent's storey.
    """
    key = np.array([seed, _STREAM], np.uint64)
    counter = np.array([0, waypoint, revision, 0], np.uint64)
    random = np.random.Generator(np.random.Philox(key=key, counter=counter))
    if area.center is None:
        assert scene is not None  # checked with the command
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
