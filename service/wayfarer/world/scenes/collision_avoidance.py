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
from wayfarer.world.avoidance.avoid import avoid
from wayfarer.world.rows import Flags, Index
from wayfarer.world.scenes.people import SessionPeople, crowd_of
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
        self.crowd = crowd_of(slots, np.empty(0, np.int64))
        """Those among whom the rows of the present step that avoid others walk."""
        self._seen: dict[int, SessionPeople] = {}

    def look(self, rows: Index) -> None:
        """A new step of `rows` begins: everybody may have moved."""
        avoiding = rows[self._slots.avoids[rows]]
        if len(avoiding):
            self.crowd = crowd_of(self._slots, avoiding)
            self._seen.clear()

    def bend(
        self, rows: Index, hips: Array, led: Index, ahead: GoalColumns, left: Array, half: Array
    ) -> None:
        """Let rows `led` of `ahead` walk around others, or wait for them.

        `rows` are their slots, `hips` [A, 2] where they are, `left` [A] metres to where each stops,
        `half` [A] half the width of their ways.
        """
        mine = np.flatnonzero(self._slots.avoids[rows])
        if not len(mine):
            return
        crowd = self.crowd
        mine = mine[crowd.in_company(rows[mine])]
        some = rows[mine]
        way = ahead.position[led[mine], :2] - hips[mine]
        distance = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
        preferred = (way / distance * ahead.speed[led[mine], None]).astype(np.float32)
        course = avoid(
            crowd.people,
            crowd.places[some],
            preferred,
            self.clearance(some),
            STEP_SECONDS,
            left[mine].astype(np.float32),
            half[mine].astype(np.float32),
            crowd.own,
        )
        self._slots.memory.put(some, course.memory)
        self._turn(ahead, led[mine], hips[mine], preferred, course.velocity, course.waits)

    def sessions(self, rows: Index, which: Index) -> Iterator[tuple[Index, SessionPeople]]:
        """Of some of the rows, those of each session, and everybody of it."""
        numbers = self._slots.session[rows[which]]
        for number in np.unique(numbers).tolist():
            mine = which[numbers == number]
            if number not in self._seen:
                self._seen[number] = self.crowd.session(int(rows[mine[0]]))
            yield mine, self._seen[number]

    def _turn(
        self,
        ahead: GoalColumns,
        led: Index,
        hips: Array,
        preferred: Array,
        chosen: Array,
        waits: Flags,
    ) -> None:
        speed = np.linalg.norm(chosen, axis=-1)
        ahead.given[led[waits]] = False
        other = ~waits & (chosen != preferred).any(-1)  # else not even by rounding
        ahead.speed[led[other]] = speed[other]
        turned = np.flatnonzero(~waits & (angle_between_ways(preferred, chosen) > TURNED))
        way = chosen[turned] / np.maximum(speed[turned], 1e-6)[:, None]
        ahead.position[led[turned], :2] = hips[turned] + REACH * way
        pass_through(ahead, led[turned], way)

    def clearance(self, rows: Index) -> Any:
        """Metres to the nearest wall at points [A, N, 2] of these rows; None: without walls."""
        numbers, floors = self._slots.scene[rows], self._slots.footing.hips[rows]
        if not numbers.any():
            return None

        def clear(points: Float) -> Float:
            found = np.full(points.shape[:2], np.inf, np.float32)
            for number in np.unique(numbers[numbers != NOWHERE]).tolist():
                mine = np.flatnonzero(numbers == number)
                heights = np.broadcast_to(floors[mine, None, None], (len(mine), points.shape[1], 1))
                places = np.concatenate([points[mine], heights], -1)
                found[mine] = self._scenery.scene(number).distance(places)
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
