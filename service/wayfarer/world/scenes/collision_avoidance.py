"""How agents give way to each other: their next stretch is bent around others."""

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

    def forget(self) -> None:
        """A new step begins: everybody may have moved."""
        self._seen.clear()

    def bend(
        self, rows: Index, hips: Array, led: Index, ahead: GoalColumns, left: Array, half: Array
    ) -> None:
        """Let rows `led` of `ahead` walk around others, or wait for them.

        `rows` are their slots, `hips` [A, 2] where they are, `left` [A] metres to where each stops,
        `half` [A] half the width of their ways.
        """
        slots = self._slots
        avoiding: Flags = slots.avoids[rows]
        for number in np.unique(slots.session[rows[avoiding]]).tolist():
            mine = np.flatnonzero(avoiding & (slots.session[rows] == number))
            others = self.others(number, rows[mine])
            if len(others.slots) < 2:
                continue
            way = ahead.position[led[mine], :2] - hips[mine]
            distance = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
            preferred = (way / distance * ahead.speed[led[mine], None]).astype(np.float32)
            clear = self.clearance(rows[mine])
            places = others.rows(rows[mine])
            stops = left[mine].astype(np.float32)
            wide = half[mine].astype(np.float32)
            course = avoid(others.people, places, preferred, clear, STEP_SECONDS, stops, wide)
            slots.memory.put(rows[mine], course.memory)
            self._turn(ahead, led[mine], hips[mine], preferred, course.velocity, course.waits)

    def others(self, session: int, rows: Index) -> SessionPeople:
        """The people of a session, once for the course and the obstacles of a step."""
        if session not in self._seen:
            self._seen[session] = people_of(self._slots, session, rows)
        return self._seen[session]

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
