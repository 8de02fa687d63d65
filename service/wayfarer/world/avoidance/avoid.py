"""Where to walk among others: the best of some ways, as fast as it is free.

Each person tries directions around its preferred one (aim.py), each at the pace that the free way
there allows, and takes the direction of least cost (kernel.py). Its pace depends on the next half
metre, as in the collision-free speed model. Its direction depends on the next seconds, as in RVO:
another person that avoids it, too, does half of the work. Bodies react slowly and do not walk well
below some speed, so a person walks faster than that or waits. A person in front has the right of
way and squeezes past, and so does a person that has waited. People keep to the right before
oncoming ones. Two that come from opposite sides and block each other are parted by their numbers:
the one of the higher number makes way.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from wayfarer.process.compiled import warm
from wayfarer.world.avoidance.aim import aim
from wayfarer.world.avoidance.kernel import (
    NEIGHBOURS,
    TRIED,
    Choices,
    Everybody,
    Next,
    Width,
    decide,
)
from wayfarer.world.avoidance.people import Float, Memory, People
from wayfarer.world.avoidance.walls import SEEN, see_walls, see_ways
from wayfarer.world.rows import Index

Clearance = Callable[[Float], Float]
"""Metres to the nearest wall [A, N] at points [A, N, 2]."""


@dataclass(frozen=True, slots=True)
class NextVelocity:
    """What [A] people shall do next."""

    velocity: Float  # [A, 2] m/s; zero for those who wait
    waits: NDArray[np.bool_]  # [A] stop, and go on when the way is free
    memory: Memory  # [A] of them for the next time


def avoid(
    people: People,
    rows: Index,
    preferred: Float,
    clear: Clearance | None,
    seconds: float,
    left: Float | None = None,
    width: Width | None = None,
    own: tuple[Index, Index] | None = None,
) -> NextVelocity:
    """The velocities that some people shall take.

    rows [A] of `people` who would walk at `preferred` [A, 2] m/s, not zero. `clear`: metres to the
    nearest wall at points [A, N, 2] of these rows, [A, N]; None: there are no walls. `seconds`:
    since they were asked last. `left` [A]: metres to where each will stop; None: nobody stops.
    `width` [A]: of their ways; None: there are no narrow ones. `own` [N]:
    where everybody's session begins and ends in `people`; None: all are of one.
    A row's result depends on the `people` of its session, not on who else is asked.
    """
    everybody, count = _everybody(people, own), len(rows)
    made = _room_for(count)
    stops = np.full(count, np.inf, np.float32) if left is None else left
    endless = np.full(count, np.inf, np.float32)
    width = width or Width(endless, endless)
    aim(everybody, rows, preferred, width.most, made)
    if clear is not None:
        points = np.empty((count, SEEN, 2), np.float32)
        see_ways(everybody, rows, made, points)
        room = np.ascontiguousarray(clear(points), np.float32)
        see_walls(everybody, rows, width.most, room, made)
    found = Next(
        velocity=np.empty((count, 2), np.float32),
        waited=np.empty(count, np.float32),
        yields=np.empty(count, np.float32),
        retreat=np.empty((count, 2), np.float32),
    )
    decide(everybody, rows, stops, width, float(seconds), made, found)
    memory = Memory(made.preferred, found.velocity, found.waited, found.yields, found.retreat)
    return NextVelocity(found.velocity, (found.velocity == 0).all(-1), memory)


@cache
def prepare() -> None:
    """Compiles the rules, or loads them, before agents walk."""
    people, row = People.empty(1), np.zeros(1, np.int64)
    made, one = _room_for(1), np.ones(1, np.float32)
    warm(aim, _everybody(people, None), row, np.ones((1, 2), np.float32), one, made)
    points = np.zeros((1, SEEN, 2), np.float32)
    warm(see_ways, _everybody(people, None), row, made, points)
    warm(see_walls, _everybody(people, None), row, one, points[..., 0].copy(), made)
    still = np.zeros(1, np.float32), np.zeros(1, np.float32)
    found = Next(np.zeros((1, 2), np.float32), *still, np.zeros((1, 2), np.float32))
    warm(decide, _everybody(people, None), row, one, Width(one, one), 0.2, made, found)


def _everybody(people: People, own: tuple[Index, Index] | None) -> Everybody:
    memory, count = people.memory, len(people.number)
    first, last = own or (np.zeros(count, np.int64), np.full(count, count))
    return Everybody(
        first,
        last,
        people.number,
        people.group,
        people.position,
        people.height,
        people.velocity,
        people.walks,
        people.radius,
        people.aims.spot,
        memory.preferred,
        memory.chosen,
        memory.waited,
        memory.yields,
        memory.retreat,
    )


def _room_for(count: int) -> Choices:
    return Choices(
        preferred=np.empty((count, 2), np.float32),
        aim=np.empty((count, 2), np.float32),
        ways=np.empty((count, TRIED, 2), np.float32),
        free=np.full((count, TRIED), np.inf),
        walls=np.zeros((count, TRIED)),
        near=np.empty((count, NEIGHBOURS), np.int64),
        known=np.empty(count, np.int64),
    )
