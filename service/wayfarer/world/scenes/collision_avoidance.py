"""How agents give way to each other: their next stretch is bent around others."""

from functools import cache
from math import acos, sqrt
from typing import Any, Final

import numpy as np

from wayfarer.process.compiled import compiled, warm
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Slots
from wayfarer.world.avoidance.avoid import avoid
from wayfarer.world.avoidance.kernel import Width
from wayfarer.world.avoidance.people import Memory
from wayfarer.world.goals.gait_rules import GoalArrays
from wayfarer.world.output.legs import packed
from wayfarer.world.output.turns import bounded
from wayfarer.world.rows import Array, Flags, Float, Index, columns
from wayfarer.world.scenes.people import crowd_of
from wayfarer.world.scenes.world_scenes import WorldScenes

REACH: Final = 1.0
"""Metres ahead of an agent of the point to which it heads when it leaves its way."""

PASSED: Final = 0.3
"""Radius in metres of a point to pass through."""

TURNED: Final = 0.1
"""Radians by which avoidance may turn an agent away from its way without its leaving it."""


class CollisionAvoidance:
    """The people of a world's sessions, and which of them give way."""

    def __init__(self, slots: Slots, scenery: WorldScenes) -> None:
        self._slots = slots
        self._scenery = scenery
        self.crowd = crowd_of(slots, np.empty(0, np.int64))
        """The people among whom the rows of the present step that avoid others walk."""

    def look(self, rows: Index) -> None:
        """Begins a new step of `rows`: all people may have moved."""
        avoiding = rows[self._slots.avoids[rows]]
        if len(avoiding):
            self.crowd = crowd_of(self._slots, avoiding)

    def bend(
        self,
        rows: Index,
        hips: Float,
        led: Index,
        memory: Memory,
        goals: GoalColumns,
        ahead: GoalColumns,
        width: Width,
    ) -> None:
        """Makes rows `led` of `ahead` walk around others, or wait for them, and remember it.

        `rows` are their slots, `hips` [A, 2] their places, `width` [A] that of their ways.
        They will stop at their `goals`.
        """
        crowd, count = self.crowd, len(rows)
        which, left = np.empty(count, np.int64), np.empty(count, np.float32)
        preferred, arrays = np.empty((count, 2), np.float32), columns(GoalArrays, ahead)
        count = prefer(
            (self._slots.avoids, crowd.places, *crowd.own),
            rows,
            hips,
            led,
            (goals.position, goals.through),
            arrays,
            (memory.preferred, memory.chosen, memory.waited),
            which,
            preferred,
            left,
        )
        if count == 0:
            return
        which, some = which[:count], rows[which[:count]]
        course = avoid(
            crowd.people,
            crowd.places[some],
            preferred[:count],
            self.clearance(some),
            STEP_SECONDS,
            left[:count],
            Width(width.most[which], width.least[which]),
            crowd.own,
        )
        memory.put(led[which], course.memory)
        turn_aside(arrays, led[which], hips[which], preferred, course.velocity, course.waits)

    def clearance(self, rows: Index) -> Any:
        """Metres to the nearest wall at points [A, N, 2] of these rows; None: without walls."""
        if not self._slots.scene[rows].any():
            return None
        return lambda points: packed(self._scenery.distance(rows, points))


@compiled
def prefer(
    crowd: tuple[Flags, Index, Index, Index],
    rows: Index,
    hips: Float,
    led: Index,
    goals: tuple[Float, Flags],
    ahead: GoalArrays,
    memory: tuple[Float, Float, Float],
    which: Index,
    preferred: Float,
    left: Float,
) -> int:
    """Finds which of `rows` walk on among others, at which velocities, and metres until they stop.
    Returns their number. The others wait: they remember where they would walk now, and how long.

    `crowd`: whether each slot avoids others, its place among the people, and the range of its
    session, [first, last). `goals`: their positions, and whether they are passed through.
    `memory`: the velocities that they wanted and took, and the seconds for which they have waited.
    """
    count, (avoids, places, first, last), (goal, through) = 0, crowd, goals
    wanted, taken, waited = memory
    for row in range(len(rows)):
        me, at = places[rows[row]], led[row]
        if not avoids[rows[row]] or last[me] - first[me] < 2:
            continue
        x, y = ahead.position[at, 0] - hips[row, 0], ahead.position[at, 1] - hips[row, 1]
        far = max(np.float32(sqrt(x * x + y * y)), np.float32(1e-6))
        x, y = x / far * ahead.speed[at], y / far * ahead.speed[at]
        if not ahead.given[at]:
            wanted[at, 0], wanted[at, 1] = x, y
            taken[at, 0] = taken[at, 1] = 0.0
            waited[at] += np.float32(STEP_SECONDS)
            continue
        preferred[count, 0], preferred[count, 1] = x, y
        x, y = goal[at, 0] - hips[row, 0], goal[at, 1] - hips[row, 1]
        left[count] = np.float32(np.inf) if through[at] else np.float32(sqrt(x * x + y * y))
        which[count] = row
        count += 1
    return count


@compiled
def turn_aside(
    ahead: GoalArrays, led: Index, hips: Float, preferred: Float, chosen: Float, waits: Flags
) -> None:
    """Makes rows `led` [A] of `ahead` walk at the chosen velocities, or wait."""
    for row in range(len(led)):
        at, x, y = led[row], chosen[row, 0], chosen[row, 1]
        if waits[row]:
            ahead.given[at] = False
        elif x != preferred[row, 0] or y != preferred[row, 1]:  # otherwise not even by rounding
            ahead.speed[at] = speed = np.float32(sqrt(x * x + y * y))
            wish_x, wish_y = preferred[row, 0], preferred[row, 1]
            wish = max(np.float32(sqrt(wish_x * wish_x + wish_y * wish_y)), np.float32(1e-6))
            x, y = x / max(speed, np.float32(1e-6)), y / max(speed, np.float32(1e-6))
            if acos(bounded(x * (wish_x / wish) + y * (wish_y / wish), -1.0, 1.0)) > TURNED:
                ahead.position[at, 0] = hips[row, 0] + np.float32(REACH) * x
                ahead.position[at, 1] = hips[row, 1] + np.float32(REACH) * y
                ahead.through[at], ahead.radius[at], ahead.bend[at] = True, PASSED, 0.0
                far = max(np.float32(sqrt(x * x + y * y)), np.float32(1e-6))
                ahead.onward[at, 0], ahead.onward[at, 1] = x / far, y / far
                if not ahead.strafe[at]:
                    ahead.heading[at, 0] = ahead.heading[at, 1] = 0.0


@cache
def prepare() -> None:
    """Compiles the rules, or loads them, before agents walk."""
    row, flag, place = np.zeros(1, np.int64), np.ones(1, np.bool_), np.ones((1, 2), np.float32)
    goal, goals = np.ones((1, 3), np.float32), columns(GoalArrays, GoalColumns.empty(1))
    crowd = flag, row, row, row
    memory = place, place, place[0, :1]
    warm(prefer, crowd, row, place, row, (goal, flag), goals, memory, row, place, place[0, :1])
    warm(turn_aside, goals, row, place, place, place, flag)


def pass_through(ahead: GoalColumns, rows: Index, way: Array) -> None:
    """Makes positions of some rows points to pass through, on the straight way [R, 2] there."""
    ahead.through[rows] = True
    ahead.radius[rows] = PASSED
    ahead.heading[rows] *= ahead.strafe[rows, None]
    ahead.bend[rows] = 0.0
    ahead.onward[rows] = way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
