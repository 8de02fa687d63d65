"""Where those want to be who look at others: pure functions of places and ways, metres and m/s."""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, dist, hypot, pi, sin
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.runtime.behaviours import Follow, KeepAway, Queue

Vector = tuple[float, float]

WALKS: Final = 0.35
"""m/s: who is slower stands, as far as those are concerned who follow."""

AHEAD: Final = 1.2
"""Metres before its place that a follower aims at, so that it walks along and not to a point."""

JOINED: Final = 1.5
"""Metres from its place within which a follower walks along; from farther away it catches up."""

SLACK: Final = 0.6
"""Metres by which the place of a standing follower may be wrong until it takes another."""

CATCH_UP: Final = 0.8
"""1/s: gain of the speed on the distance to one's place."""

FASTEST: Final = 2.2
SLOWEST: Final = 0.4

FLIGHT: Final = 3.0
"""Metres that are looked ahead by who keeps away …"""

CORNERED: Final = 0.6
"""… and below which it stays where it is."""

CALM: Final = 1.25
"""Times the distance to keep at which it stands again."""

_RUNS: Final = np.arange(0.3, FLIGHT + 0.01, 0.3)
_TURNS: Final = np.array([(cos(k * pi / 12), sin(k * pi / 12)) for k in range(24)])


@dataclass(frozen=True, slots=True)
class Body:
    """An agent as others see it."""

    place: Vector
    velocity: Vector
    facing: Vector  # unit vector

    @property
    def speed(self) -> float:
        """Metres per second."""
        return hypot(*self.velocity)


@dataclass(frozen=True, slots=True)
class Aim:
    """What an agent wants for now; `place` None: to stand."""

    place: Vector | None
    speed: float = 1.2
    onward: Vector | None = None  # unit vector: it is passed through in that direction
    facing: Vector | None = None  # unit vector to face once there


STAND: Final = Aim(None)


def follow(wish: Follow, me: Body, leader: Body, last: Vector | None) -> Aim:
    """Keep to a place relative to `leader`; `last` is where that was while it stood."""
    if leader.speed < WALKS:
        place = _beside(wish, leader.place, leader.facing)
        reach = hypot(wish.behind, wish.right) + SLACK
        if last is not None and 0.5 < dist(last, leader.place) < reach:
            place = last  # it turned, or sways: no reason to walk around it
        return Aim(place, facing=leader.facing)
    x, y = leader.velocity
    way = x / leader.speed, y / leader.speed
    place = _beside(wish, leader.place, way)
    off = place[0] - me.place[0], place[1] - me.place[1]
    if hypot(*off) > JOINED:
        return Aim(place, speed=min(max(leader.speed + 0.6, 1.4), FASTEST), onward=way)
    along = off[0] * way[0] + off[1] * way[1]
    speed = min(max(leader.speed + CATCH_UP * along, SLOWEST), FASTEST)
    aim = place[0] + AHEAD * way[0], place[1] + AHEAD * way[1]
    return Aim(aim, speed=speed, onward=way)


def keep_away(
    wish: KeepAway,
    me: Body,
    threat: Vector,
    flees: bool,
    room: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None,
) -> Aim:
    """Away from `threat` if it is too near, and once one `flees` until it is far enough.

    `room`: how far points [D, R, 2] are inside the ground that can be walked on [D, R], negative
    outside; None: all of it can.
    """
    apart = dist(me.place, threat)
    if apart > wish.distance * (CALM if flees else 1.0):
        return STAND
    place = np.array(me.place)
    free = np.full(len(_TURNS), FLIGHT)
    if room is not None:
        points = place + _TURNS[:, None] * _RUNS[:, None]
        shut = room(points) < 0
        free = np.where(shut.any(1), _RUNS[shut.argmax(1)] - _RUNS[0], FLIGHT)
    ends = place + _TURNS * free[:, None]
    gain = np.hypot(*(ends - threat).T) + 0.3 * (_TURNS @ me.velocity) / max(me.speed, 1.0)
    gain[free < CORNERED] = -np.inf
    best = int(gain.argmax())
    if gain[best] <= apart:
        return STAND
    x, y = ends[best].tolist()
    way = float(_TURNS[best, 0]), float(_TURNS[best, 1])
    return Aim((x, y), speed=wish.speed, onward=way)


def queue_place(wish: Queue, number: float) -> Vector:
    """Where number 0, 1, 2 … of a queue stands, or somebody between them."""
    back = number * wish.spacing
    return wish.head[0] + back * sin(wish.heading), wish.head[1] - back * cos(wish.heading)


def patrolled(step: int, count: int, to_and_fro: bool) -> int:
    """Which of `count` goals is number `step` of a patrol."""
    if not to_and_fro or count == 1:
        return step % count
    turn = step % (2 * count - 2)
    return min(turn, 2 * count - 2 - turn)


def _beside(wish: Follow, place: Vector, way: Vector) -> Vector:
    """Behind and to the right of somebody who looks along `way`."""
    x, y = way
    return (
        place[0] - wish.behind * x + wish.right * y,
        place[1] - wish.behind * y - wish.right * x,
    )
