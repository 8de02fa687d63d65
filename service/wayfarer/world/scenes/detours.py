"""Ways around people who stand in the way, and who they are where no way leads around them."""

from collections.abc import Sequence
from math import dist
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import FailedPrecondition, Unreachable
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import Cylinder, Floor, SceneSpec
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.route import Passage
from wayfarer.world.agents.slots import Slots
from wayfarer.world.rows import Flags, Index
from wayfarer.world.scenes.people import SessionPeople
from wayfarer.world.scenes.planner import RETRY
from wayfarer.world.scenes.routes import Routes
from wayfarer.world.scenes.world_scenes import NOWHERE, WorldScenes

Array = NDArray[np.floating[Any]]

AHEAD: Final = np.arange(0.2, 4.01, 0.2)
"""Metres along its way at which an agent looks for people who stand in it."""

IN_WAY: Final = 0.36
"""Metres from the way within which somebody stands in it."""

TRUNK: Final = 0.12
"""Metres: radius of an agent that stands, as an obstacle. Ways keep the walker's radius from it, so
their hips pass at .43 m: shoulders are .42 m wide."""

AROUND: Final = 10.0
"""Metres from an agent within which people who stand are planned around."""

MOST: Final = 64
"""People who are planned around at a time, the nearest."""

LONGER: Final = 2.0
"""A way around is taken up to this share of the way that is left …"""

BIT: Final = 1.0
"""… and this many metres more."""

STOPS: Final = 1.2
"""Metres from somebody in its way at which an agent without a way around brakes: .75 m are left."""

MARGIN: Final = 5.0
"""Metres of the flat floor around those concerned on which a way is looked for."""

KEPT: Final = 8
"""Scenes with people in them that are kept: agents near each other ask for the same."""


class Barred(NamedTuple):
    """What stands in the ways of some rows [A]."""

    is_barred: Flags
    near: Array  # metres to the nearest of them; inf: nobody
    by: NDArray[np.bool_]  # [A, N] rows of the session's people


class Detours:
    """Plans ways around people, and lays them."""

    def __init__(self, slots: Slots, routes: Routes, scenery: WorldScenes) -> None:
        self._slots = slots
        self._routes = routes
        self._scenery = scenery
        self._with_people: dict[object, Scene | None] = {}

    def update(self, rows: Index, hips: Array, goals: Array, everybody: SessionPeople) -> Barred:
        """Let rows of one session that want to go to `goals` [A, 3] walk around people who stand.

        A way around is laid as the route. One is looked for in a call, by whoever waits longest.
        """
        slots, route, aims = self._slots, self._slots.route, self._slots.aims
        barred = self._barred(rows, hips, goals, everybody)
        seconds = np.where(barred.is_barred, aims.barred[rows] + STEP_SECONDS, 0)
        aims.barred[rows] = seconds
        flat = slots.scene[rows] == NOWHERE
        route.wait[rows[flat]] = np.maximum(route.wait[rows[flat]] - 1, 0)
        due = np.flatnonzero(barred.is_barred & (route.wait[rows] == 0))
        if len(due):
            row = int(due[seconds[due].argmax()])
            route.wait[rows[row]] = RETRY
            if self._look(int(rows[row]), hips[row], goals[row], everybody):
                barred.is_barred[row] = False
        return barred

    def ahead(self, rows: Index, hips: Array, goals: Array, metres: Array) -> Array:
        """Points [A, S, 2] at `metres` [S] ahead on the ways of rows to `goals` [A, 3]."""
        way = goals[:, :2] - hips
        length = np.linalg.norm(way, axis=-1)
        along = np.minimum(metres, length[:, None]) / np.maximum(length, 1e-6)[:, None]
        points: Array = hips[:, None] + along[..., None] * way[:, None]
        led = np.flatnonzero(self.is_led(rows))
        if len(led):
            route = self._slots.route
            here, ends = route.progress[rows[led]], route.length[rows[led]]
            at = np.minimum(here[:, None] + metres, ends[:, None])
            points[led] = self._routes.at(rows[led], at)[..., :2]
        return points

    def is_led(self, rows: Index) -> Flags:
        """Rows that have a route to their present goal."""
        route = self._slots.route
        known = route.revision[rows] == self._slots.goal_revision[rows]
        known &= route.waypoint[rows] == self._slots.planned.gait.waypoint[rows]
        led: Flags = known & (route.passage[rows] == Passage.OPEN)
        return led

    # Within

    def _barred(self, rows: Index, hips: Array, goals: Array, everybody: SessionPeople) -> Barred:
        people, me = everybody.people, everybody.rows(rows)
        by = np.zeros((len(rows), len(people.number)), np.bool_)
        near = np.full(len(rows), np.inf)
        stand = np.flatnonzero(everybody.stand)
        if not len(stand):
            return Barred(np.zeros(len(rows), np.bool_), near, by)
        points = self.ahead(rows, hips, goals, AHEAD)
        places = people.position[stand]
        gaps = np.linalg.norm(points[:, :, None] - places, axis=-1).min(1)  # [A, S]
        level = np.abs(people.height[stand] - people.height[me][:, None]) < 1.0
        hit = (gaps < IN_WAY) & level & (stand != me[:, None])
        by[:, stand] = hit
        apart = np.linalg.norm(places - hips[:, None], axis=-1)
        near = np.where(hit, apart, np.inf).min(1)
        return Barred(hit.any(1), near, by)

    def _look(self, slot: int, place: Array, goal: Array, everybody: SessionPeople) -> bool:
        """Look for a way around; returns whether there is one."""
        slots, route = self._slots, self._slots.route
        people = everybody.people
        me = int(everybody.rows(np.array([slot]))[0])
        away = np.linalg.norm(people.position - place, axis=-1)
        stand = everybody.stand & (away < AROUND) & (np.abs(people.height - people.height[me]) < 1)
        stand[me] = False
        who = np.flatnonzero(stand)
        who = np.sort(who[np.argsort(away[who], kind="stable")[:MOST]])
        floor = float(slots.footing.hips[slot])
        spots = [(x, y, floor) for x, y in people.position[who].astype(np.float64).tolist()]
        start = float(place[0]), float(place[1]), floor
        end = float(goal[0]), float(goal[1]), float(goal[2])
        led = bool(self.is_led(np.array([slot]))[0])
        rest = float(route.length[slot] - route.progress[slot]) if led else dist(start[:2], end[:2])
        number = int(slots.scene[slot])
        scene = self._scenery.scene(number) if number else _floor([start, end, *spots])
        crowded = self._crowded(scene if number else None, scene, spots)
        if crowded is None:
            return False
        try:
            path = crowded.path(start, end)
        except Unreachable:
            return False
        if path.goal_moved > 0.3 or path.length > LONGER * rest + BIT:
            return False
        waypoint = int(slots.planned.gait.waypoint[slot])
        self._routes.lay(slot, path.points, int(slots.goal_revision[slot]), waypoint)
        return True

    def _crowded(
        self, known: Scene | None, scene: Scene, spots: Sequence[tuple[float, float, float]]
    ) -> Scene | None:
        """The scene with people at these places; None: no ground would be left."""
        key = known, tuple((round(x, 2), round(y, 2)) for x, y, _ in spots)
        if known is not None and key in self._with_people:
            return self._with_people[key]
        people = {
            f"person {number}": Cylinder((x, y), TRUNK, 1.8, floor)
            for number, (x, y, floor) in enumerate(spots)
        }
        found: Scene | None
        try:
            found = scene.with_people(people)
        except FailedPrecondition:
            found = None
        if known is not None:
            while len(self._with_people) >= KEPT:
                del self._with_people[next(iter(self._with_people))]
            self._with_people[key] = found
        return found


def _floor(points: Sequence[tuple[float, ...]]) -> Scene:
    """The flat floor around points, as a scene."""
    (x0, y0), (x1, y1) = (
        (bound([p[0] for p in points]), bound([p[1] for p in points])) for bound in (min, max)
    )
    low, high = (x0 - MARGIN, y0 - MARGIN), (x1 + MARGIN, y1 + MARGIN)
    corners = (low, (high[0], low[1]), high, (low[0], high[1]))
    return bake(SceneSpec(floors=(Floor(corners),)))
