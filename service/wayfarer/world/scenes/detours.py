"""Ways around people in the way, and the people that block if there is no such way."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.slots import Slots
from wayfarer.world.rows import Array, Flags, Float, Index
from wayfarer.world.scenes.around import keep_apart, stand_before, way_around
from wayfarer.world.scenes.people import Gathering, SessionPeople
from wayfarer.world.scenes.planner import RETRY
from wayfarer.world.scenes.routes import Routes
from wayfarer.world.scenes.world_scenes import NOWHERE, WorldScenes

AHEAD: Final = np.arange(0.2, 4.01, 0.2)
"""Metres along its way at which an agent looks for standing people."""

IN_WAY: Final = 0.36
"""Metres from the way within which a person stands in it."""

PASSES: Final = 0.42
"""Metres between a way around and a standing person: shoulders are .42 m wide, and the places that
are tried are not the best ones."""

AROUND: Final = 8.0
"""Metres along its way within which a way around returns to it or to its end."""

ASIDE: Final = 5.0
"""Metres to the sides of that stretch within which a way around is looked for."""

CELL: Final = 0.15
"""Metres between the places that are tried."""

SLACK: Final = 0.05
"""Metres by which they may be nearer to a wall than the walker's radius: they are `CELL` apart."""

MOST: Final = 512
"""Maximum corners of a way around."""

LONGER: Final = 2.0
"""Maximum length of a way around, as a multiple of the way that it replaces."""

BIT: Final = 1.0
"""Metres added to that maximum."""

STOPS: Final = 1.2
"""Metres from a person in its way at which an agent without a way around brakes: .75 m remain."""


class Barred(NamedTuple):
    """The people in the ways of some rows [A]."""

    is_barred: Flags
    near: Array  # metres to the nearest of them; inf: none
    first: Index  # that one
    by: NDArray[np.bool_]  # [A, S] which people of their session: rows from its first on
    seconds: Array  # for which they have closed the way


class Detours:
    """Plans ways around people, and lays them."""

    def __init__(self, slots: Slots, routes: Routes, scenery: WorldScenes) -> None:
        self._slots = slots
        self._routes = routes
        self._scenery = scenery

    def update(
        self, rows: Index, hips: Array, goals: Array, crowd: Gathering, seconds: Float
    ) -> Barred:
        """Makes rows that want to go to `goals` [A, 3] walk around standing people, which have
        closed their ways for `seconds` [A].

        A way around becomes the route. One is looked for per call and session, for the agent that
        has waited longest.
        """
        slots, route = self._slots, self._slots.route
        barred = self._barred(rows, hips, goals, crowd, seconds)
        flat = slots.scene[rows] == NOWHERE
        route.wait[rows[flat]] = np.maximum(route.wait[rows[flat]] - 1, 0)
        due = np.flatnonzero(barred.is_barred & (route.wait[rows] == 0))
        sessions = slots.session[rows[due]]
        for number in sorted(set(sessions.tolist())):
            some = due[sessions == number]
            row = int(some[barred.seconds[some].argmax()])
            slot = int(rows[row])
            route.wait[slot] = RETRY
            if self._look(slot, hips[row], goals[row], crowd.session(slot)):
                barred.is_barred[row] = False
        return barred

    # Private

    def _barred(
        self, rows: Index, hips: Array, goals: Array, crowd: Gathering, seconds: Float
    ) -> Barred:
        me, (first, last) = crowd.places[rows], crowd.own
        near, nearest = np.full(len(rows), np.inf), np.zeros(len(rows), np.int64)
        by = np.zeros((len(rows), int((last - first).max())), np.bool_)
        if crowd.stand.any():
            points, people = self._routes.ahead(rows, hips, goals, AHEAD), crowd.people
            own, standing = (first[me], last[me]), (people.position, people.height, crowd.stand)
            stand_before(me, np.float64(hips), points, own, standing, IN_WAY, near, nearest, by)
        is_barred = np.isfinite(near)
        since = np.where(is_barred, seconds + STEP_SECONDS, 0)
        return Barred(is_barred, near, nearest, by, since)

    def _look(self, slot: int, place: Array, goal: Array, everybody: SessionPeople) -> bool:
        """Looks for a way around, and lays it; returns whether there is one."""
        people, me = everybody.people, int(everybody.rows(np.array([slot]))[0])
        row, level = np.array([slot]), everybody.level(me)
        [back] = self._routes.ahead(row, place[None], goal[None], np.array([AROUND]))[0]
        low = np.minimum(place, back) - ASIDE
        columns, rows = np.ceil((np.maximum(place, back) + ASIDE - low) / CELL).astype(int)
        x, y = low[0] + CELL * np.arange(columns), low[1] + CELL * np.arange(rows)
        (clear, radius), cells = self._scenery.walls(slot), np.stack(np.meshgrid(x, y), -1)
        room = clear(cells.reshape(-1, 2)).reshape(rows, columns).astype(np.float64)
        room -= radius - SLACK
        keep_apart(room, low, CELL, people.position[everybody.stand & level], PASSES)
        ends = np.rint((np.stack([place, back]) - low) / CELL).astype(np.int64)[:, ::-1].copy()
        corners = np.empty((MOST, 2), np.int64)
        count = way_around(room, ends[0], ends[1], corners)
        if count == 0:
            return False
        points = low + CELL * corners[:count, ::-1]
        points[0] = place
        if (corners[count - 1] == ends[1]).all():  # else somebody stands there
            points[-1] = back
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        route, straight = self._slots.route, float(np.linalg.norm(goal[:2] - place))
        led = self._routes.is_led(row)[0]
        direct = float(route.length[slot] - route.progress[slot]) if led else straight
        if length > LONGER * min(AROUND, direct) + BIT:
            return False
        self._lay(slot, points, goal)
        return True

    def _lay(self, slot: int, points: Array, goal: Array) -> None:
        """Leads a slot through points [P, 2], and then along the rest of its way to `goal`."""
        slots = self._slots
        number, floor = int(slots.scene[slot]), float(slots.footing.hips[slot])
        whole = np.column_stack([points, np.full(len(points), floor)])
        if number != NOWHERE:
            whole[:, 2] = self._scenery.scene(number).floor(whole)
        led = self._routes.is_led(np.array([slot]))[0]
        rest = self._routes.rest(slot, AROUND) if led else goal[None]
        if np.linalg.norm(rest[-1, :2] - points[-1]) > CELL:
            whole = np.concatenate([whole, rest])
        waypoint = int(slots.planned.gait.waypoint[slot])
        self._routes.lay(slot, whole, int(slots.goal_revision[slot]), waypoint)
