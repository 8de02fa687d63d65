"""Ways of agents through their scenes, as columns: the progress on each, and the way ahead."""

from collections.abc import Sequence
from functools import cache
from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.world.agents.route import WAY, Passage, Route
from wayfarer.world.agents.slots import Slots
from wayfarer.world.rows import Array, Double, Flags, Float, Index, Int, Int8

BACK: Final = 0.5
"""Metres that an agent that was pushed or replanned may be behind its former place."""

WINDOW: Final = 2.0
"""Metres ahead within which it is looked for, so that it does not jump to a nearby stretch."""


OPEN = int(Passage.OPEN)


class Ways(NamedTuple):
    """The ways of all slots, and the goals for which they were made; see `Route`."""

    points: Double  # [S, P, 3]
    along: Double  # [S, P] metres from the start
    corners: Int
    passage: Int8
    revision: Int
    goal_revision: Int
    waypoint: Int
    goal: Int  # the waypoint that the slot is on the way to
    progress: Float
    length: Float


class Routes:
    """Polylines of all slots of a table, padded with their last point. World space, metres."""

    def __init__(self, slots: Slots) -> None:
        self._slots = slots
        self._points = np.zeros((0, 16, 3))
        self._along = np.zeros((0, 16))

    def lay(self, slot: int, points: Array, revision: int, waypoint: int) -> None:
        """Leads a slot through points [P, 3] to a goal of its path."""
        self._reserve(len(points))
        steps = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        self._points[slot, : len(points)] = points
        self._points[slot, len(points) :] = points[-1]
        self._along[slot, : len(points)] = along
        self._along[slot, len(points) :] = along[-1]
        route = self._slots.route
        route.passage[slot] = Passage.OPEN
        route.revision[slot], route.waypoint[slot] = revision, waypoint
        route.points[slot], route.length[slot] = len(points), along[-1]
        route.progress[slot] = 0.0
        route.doubt[slot] = False

    def follow(self, rows: Index, places: Float) -> Array:
        """Advances to the points of the ways nearest to places [A, 2]; returns distances [A]."""
        off = np.empty(len(rows))
        follow_ways(self.ways, rows, places, off)
        return off

    def ends(self, rows: Index) -> Array:
        """The last points [A, 3] of the ways."""
        return self._points[rows, -1]

    def at(self, rows: Index, metres: Array) -> Array:
        """Points [A, S, 3] of the ways at `metres` [A, S] from their starts."""
        found = np.empty((*metres.shape, 3))
        points_at(self.ways, rows, metres, found)
        return found

    def ahead(self, rows: Index, hips: Float, goals: Float, metres: Array) -> Double:
        """Points [A, S, 2] at `metres` [S] ahead on the ways of rows to `goals` [A, 3]; straight
        from `hips` [A, 2] if there is no route.
        """
        found = np.empty((len(rows), len(metres), 2))
        points_ahead(self.ways, rows, hips, goals, metres, found)
        return found

    @property
    def ways(self) -> Ways:
        """All present ways."""
        self._reserve()
        slots, route = self._slots, self._slots.route
        gait = slots.planned.gait.waypoint
        known = route.passage, route.revision, slots.goal_revision, route.waypoint, gait
        return Ways(self._points, self._along, route.points, *known, route.progress, route.length)

    def is_led(self, rows: Index) -> Flags:
        """Rows that have a route to their present goal."""
        ways, found = self.ways, np.empty(len(rows), np.bool_)
        find_led(ways, rows, found)
        return found

    def rest(self, slot: int, beyond: float = 0.0) -> Array:
        """The part of a way more than `beyond` metres ahead: points [P, 3], P ≥ 1."""
        route = self._slots.route
        begin, count = float(route.progress[slot]) + beyond, int(route.points[slot])
        here = self.at(np.array([slot]), np.array([[begin]]))[0]
        ahead = self._along[slot, :count] > begin
        return np.concatenate([here, self._points[slot, :count][ahead]])

    def forget(self, rows: Index | Sequence[int]) -> None:
        """Removes the ways of these rows."""
        self._slots.route.passage[rows] = Passage.UNKNOWN

    def take(self, rows: Index) -> tuple[Route, Double]:
        """The routes of these rows, and their points [A, WAY, 3]."""
        self._reserve(WAY)
        return self._slots.route.take(rows), self._points[rows, :WAY]

    def put(self, rows: Index, route: Route, points: Array) -> None:
        """Gives these rows what `take` returned; a longer way is searched again."""
        fits = (route.points > 1) & (route.points <= WAY)
        for row in np.flatnonzero(fits).tolist():
            self.lay(int(rows[row]), points[row, : route.points[row]], 0, 0)
        route.passage[(route.passage == OPEN) & ~fits] = Passage.UNKNOWN
        self._slots.route.put(rows, route)

    def _reserve(self, points: int = 0) -> None:
        slots, width = len(self._slots.active), self._along.shape[1]
        if slots <= len(self._along) and points <= width:
            return
        wider = width if points <= width else 1 << (points - 1).bit_length()
        # The padding repeats the last point.
        self._points = np.pad(self._points, ((0, 0), (0, wider - width), (0, 0)), "edge")
        self._along = np.pad(self._along, ((0, 0), (0, wider - width)), "edge")
        more = slots - len(self._along)
        self._points = np.pad(self._points, ((0, more), (0, 0), (0, 0)))
        self._along = np.pad(self._along, ((0, more), (0, 0)))


@inner
def _is_led(ways: Ways, slot: int) -> bool:
    known = ways.revision[slot] == ways.goal_revision[slot]
    known = known and ways.waypoint[slot] == ways.goal[slot]
    return known and ways.passage[slot] == OPEN


@inner
def _point(ways: Ways, slot: int, metres: float) -> tuple[float, float, float]:
    k, last = 0, max(ways.corners[slot] - 2, 0)
    while k < last and ways.along[slot, k + 1] <= metres:
        k += 1
    before = ways.along[slot, k]
    share = min(max((metres - before) / max(ways.along[slot, k + 1] - before, 1e-9), 0.0), 1.0)
    x, y, z = ways.points[slot, k, 0], ways.points[slot, k, 1], ways.points[slot, k, 2]
    return (
        x + share * (ways.points[slot, k + 1, 0] - x),
        y + share * (ways.points[slot, k + 1, 1] - y),
        z + share * (ways.points[slot, k + 1, 2] - z),
    )


@compiled
def find_led(ways: Ways, rows: Index, found: Flags) -> None:
    """See `Routes.is_led`."""
    for row in range(len(rows)):
        found[row] = _is_led(ways, rows[row])


@compiled
def points_at(ways: Ways, rows: Index, metres: Double, found: Double) -> None:
    """See `Routes.at`."""
    for row in range(len(rows)):
        for k in range(metres.shape[1]):
            x, y, z = _point(ways, rows[row], metres[row, k])
            found[row, k, 0], found[row, k, 1], found[row, k, 2] = x, y, z


@compiled
def points_ahead(
    ways: Ways, rows: Index, hips: Float, goals: Float, metres: Double, found: Double
) -> None:
    """See `Routes.ahead`."""
    for row in range(len(rows)):
        slot, led = rows[row], _is_led(ways, rows[row])
        way_x, way_y = goals[row, 0] - hips[row, 0], goals[row, 1] - hips[row, 1]
        length = np.float32(sqrt(way_x * way_x + way_y * way_y))
        for k in range(len(metres)):
            if led:
                at = min(ways.progress[slot] + metres[k], float(ways.length[slot]))
                found[row, k, 0], found[row, k, 1], _ = _point(ways, slot, at)
            else:
                on = min(metres[k], float(length)) / max(length, np.float32(1e-6))
                found[row, k, 0] = hips[row, 0] + on * way_x
                found[row, k, 1] = hips[row, 1] + on * way_y


@compiled
def follow_ways(ways: Ways, rows: Index, places: Float, off: Double) -> None:
    """See `Routes.follow`."""
    for row in range(len(rows)):
        slot, least, here = rows[row], np.inf, 0.0
        since = float(ways.progress[slot])
        for k in range(
            min(max(ways.corners[slot], 1), ways.along.shape[1] - 1)
        ):  # the end counts as one, too
            start, end = ways.along[slot, k], ways.along[slot, k + 1]
            low, high = max(start, since - BACK), min(end, since + WINDOW)
            x, y = ways.points[slot, k, 0], ways.points[slot, k, 1]
            size = max(end - start, 1e-9)
            way_x = (ways.points[slot, k + 1, 0] - x) / size
            way_y = (ways.points[slot, k + 1, 1] - y) / size
            x, y = places[row, 0] - x, places[row, 1] - y
            share = min(max(x * way_x + y * way_y, low - start), high - start)
            if k == 0:
                here = start + share
            x, y = x - share * way_x, y - share * way_y
            if low <= high and x * x + y * y < least:
                least, here = x * x + y * y, start + share
        ways.progress[slot] = here
        off[row] = sqrt(least)


@cache
def prepare() -> None:
    """Compiles the rules, or loads them, before agents walk."""
    routes, row = Routes(Slots.empty(1)), np.zeros(1, np.int64)
    place, goal, found = (
        np.zeros((1, 2), np.float32),
        np.zeros((1, 3), np.float32),
        np.zeros((1, 1, 3)),
    )
    warm(find_led, routes.ways, row, np.zeros(1, np.bool_))
    warm(points_at, routes.ways, row, found[0, :, :1], found)
    warm(points_ahead, routes.ways, row, place, goal, np.zeros(1), found)
    warm(follow_ways, routes.ways, row, place, np.zeros(1))
