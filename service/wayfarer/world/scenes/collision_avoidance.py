"""How agents give way to each other: their next stretch is bent around others."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.engines.engine import Float
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.heading import angle_between
from wayfarer.world.agents.slots import Slots
from wayfarer.world.avoidance.avoid import NextVelocity, avoid
from wayfarer.world.avoidance.people import Memory
from wayfarer.world.rows import Index
from wayfarer.world.scenes.people import SessionPeople, people_of
from wayfarer.world.scenes.world_scenes import NOWHERE, WorldScenes

Array = NDArray[np.floating[Any]]

REACH: Final = 1.0
"""Metres ahead of an agent that it heads for when it leaves its way."""

PASSED: Final = 0.3
"""Metres: radius of a point to pass through."""

TURNED: Final = 0.1
"""Radians that avoidance may turn an agent away from its way without its leaving it."""


class CollisionAvoidance:
    """The people of a world's sessions, and who of them gives way."""

    def __init__(self, slots: Slots, scenery: WorldScenes) -> None:
        self._slots = slots
        self._scenery = scenery
        self._seen: dict[int, SessionPeople] = {}

    def look(self, rows: Index) -> None:
        """A new step of `rows` begins: everybody may have moved."""
        avoiding = rows[self._slots.avoids[rows]]
        self._seen = people_of(self._slots, avoiding) if len(avoiding) else {}

    def bend(
        self, rows: Index, hips: Array, led: Index, ahead: GoalColumns, left: Array, half: Array
    ) -> None:
        """Let rows `led` of `ahead` walk around others, or wait for them.

        `rows` are their slots, `hips` [A, 2] where they are, `left` [A] metres to where each stops,
        `half` [A] half the width of their ways.
        """
        way = ahead.position[led, :2] - hips
        distance = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
        preferred = (way / distance * ahead.speed[led, None]).astype(np.float32)
        left, half = left.astype(np.float32), half.astype(np.float32)
        which, courses = list[Index](), list[NextVelocity]()
        for mine, others in self.sessions(rows, np.flatnonzero(self._slots.avoids[rows])):
            if len(others.slots) > 1:
                some, clear = others.rows(rows[mine]), self.clearance(rows[mine])
                wanted, stops, wide = preferred[mine], left[mine], half[mine]
                which.append(mine)
                courses.append(avoid(others.people, some, wanted, clear, STEP_SECONDS, stops, wide))
        if which:
            mine = np.concatenate(which)
            self._slots.memory.put(rows[mine], Memory.join([course.memory for course in courses]))
            chosen = np.concatenate([course.velocity for course in courses])
            self._turn(ahead, led[mine], hips[mine], preferred[mine], chosen)

    def sessions(self, rows: Index, which: Index) -> Iterator[tuple[Index, SessionPeople]]:
        """Of some of the rows, those of each session, and everybody of it."""
        numbers = self._slots.session[rows[which]]
        for number in np.unique(numbers).tolist():
            yield which[numbers == number], self._seen[number]

    def everybody(self, slot: int) -> SessionPeople:
        """The people of a slot's session."""
        return self._seen[int(self._slots.session[slot])]

    def _turn(
        self,
        ahead: GoalColumns,
        led: Index,
        hips: Array,
        preferred: Array,
        chosen: Array,
    ) -> None:
        speed, waits = np.linalg.norm(chosen, axis=-1), (chosen == 0).all(-1)
        ahead.given[led[waits]] = False
        other = ~waits & (chosen != preferred).any(-1)  # else not even by rounding
        ahead.speed[led[other]] = speed[other]
        turned = np.flatnonzero(~waits & (angle_between_ways(preferred, chosen) > TURNED))
        way = chosen[turned] / np.maximum(speed[turned], 1e-6)[:, None]
        ahead.position[led[turned], :2] = hips[turned] + REACH * way
        pass_through(ahead, led[turned], way)

    def clearance(self, rows: Index) -> Any:
        """Metres to the nearest wall at points [A, N, 2] of these rows, of one session.

        None: there are no walls.
        """
        slots = self._slots
        number = int(slots.scene[rows[0]])
        if number == NOWHERE:
            return None
        scene = self._scenery.scene(number)
        floors = slots.footing.hips[rows]

        def clear(points: Float) -> Float:
            heights = np.broadcast_to(floors[:, None, None], (*points.shape[:2], 1))
            found: Float = scene.distance(np.concatenate([points, heights], -1))
            return found

        return clear


def pass_through(ahead: GoalColumns, rows: Index, way: Array) -> None:
    """Let positions of some rows be passed through, the way there [R, 2] being straight on."""
    ahead.through[rows] = True
    ahead.radius[rows] = PASSED
    ahead.heading[rows] *= ahead.strafe[rows, None]
    ahead.bend[rows] = 0.0
    ahead.onward[rows] = way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)


def angle_between_ways(a: Array, b: Array) -> Array:
    """Angle [A] between vectors [A, 2] of any length."""
    long = [v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-6) for v in (a, b)]
    return angle_between(long[0], long[1])
