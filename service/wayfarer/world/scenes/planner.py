"""Finds agents' ways through their scenes, and reports goals that cannot be reached.

A way leads to one goal of the agent's path and is searched when that goal's turn comes. It is
searched again when a change of the scene has closed it, when the agent has been pushed off it, and
when its goal has moved.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from wayfarer.errors import Metres, Text, Unreachable, spot
from wayfarer.navigation.scene_spec import Point3
from wayfarer.world.agents.faults import Faults, Stage
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.route import Passage
from wayfarer.world.agents.slots import Motion, Slots
from wayfarer.world.events import EventKind
from wayfarer.world.rows import Array, Flags, Index
from wayfarer.world.scenes.routes import Routes
from wayfarer.world.scenes.world_scenes import WorldScenes

OFF: Final = 1.2
"""Metres from its way at which an agent looks for another one."""

ASTRAY: Final = (0.5, 3.0)
"""Metres from its way and seconds of waiting from which it looks, too: others may have pushed it
through a door, so that a wall is now between it and its way.
"""

GOAL_MOVES: Final = 0.4
GOAL_SHARE: Final = 0.15
"""Minimum movement of a goal, as a follower's, after which its way is looked for again: metres, and
share of the rest of the way.
"""

RETRY: Final = 5
"""Steps between two checks whether a closed way has opened."""

MOVED: Final = 0.01
"""Metres of movement below which a goal counts as unmoved."""

Tell = Callable[[int, EventKind, int, Text], None]
"""Receives (slot, kind, waypoint, text)."""


@dataclass(eq=False)
class Planner:
    """Keeps the routes of a world up to date."""

    slots: Slots
    routes: Routes
    scenery: WorldScenes
    move: Callable[[int, int, Array], None]  # (slot, waypoint, place) moves a goal of a path
    tell: Tell
    at_once: int  # most ways found in an update, a millisecond each; other agents wait a step
    faults: Faults

    def update(
        self, rows: Index, places: Array, start: Motion, goals: GoalColumns, wanted: Flags
    ) -> None:
        """Looks for ways of the rows that are `wanted` and need one: places [A, 2]."""
        gait, route = start.gait, self.slots.route
        known = (
            (route.passage[rows] != Passage.UNKNOWN)
            & (route.revision[rows] == self.slots.goal_revision[rows])
            & (route.waypoint[rows] == gait.waypoint)
        )
        opened = known & (route.passage[rows] == Passage.OPEN)
        lost = np.zeros(len(rows), np.bool_)
        if opened.any():
            lost[opened] = self._lost(rows[opened], places[opened], goals.position[opened])
        route.wait[rows] = np.maximum(route.wait[rows] - 1, 0)
        due = wanted & (~known | lost)
        due |= wanted & known & (route.passage[rows] == Passage.CLOSED) & self._may_open(rows)
        due |= wanted & opened & self._closed(rows, opened)
        if self.faults.any:
            due &= ~self.faults.out(rows, Stage.WAY)
        asked, spot = start.aims.asked, start.aims.spot
        for row in np.flatnonzero(due)[: self.at_once].tolist():
            slot, waypoint, goal = int(rows[row]), int(gait.waypoint[row]), goals.position[row]
            is_spot = (goal[:2] == spot[row]).all() and (asked[row] != spot[row]).any()
            try:
                self._look(slot, places[row], waypoint, goal, bool(known[row]), bool(is_spot))
            except Exception as error:  # it waits in place, as if no way led to its goal
                self.faults.agents([slot], Stage.WAY, error, holds=False)

    def _lost(self, rows: Index, places: Array, goals: Array) -> Flags:
        """Rows on open ways that are far off their way, and rows whose goal has moved."""
        route = self.slots.route
        off = self.routes.follow(rows, places)
        moved = np.linalg.norm(self.routes.ends(rows)[:, :2] - goals[:, :2], axis=-1)
        left = route.length[rows] - route.progress[rows]
        gone: Flags = moved > np.maximum(GOAL_MOVES, GOAL_SHARE * left)
        waits = self.slots.planned.memory.waited[rows] > ASTRAY[1]
        astray = (off > OFF) | (off > ASTRAY[0]) & waits
        return gone | astray & (route.wait[rows] == 0)

    def _may_open(self, rows: Index) -> Flags:
        route = self.slots.route
        again: Flags = route.doubt[rows] | (route.wait[rows] == 0)
        return again

    def _closed(self, rows: Index, opened: Flags) -> Flags:
        """Open ways that a change of the scene has closed."""
        route = self.slots.route
        found = np.zeros(len(rows), np.bool_)
        for row in np.flatnonzero(opened & route.doubt[rows]).tolist():
            slot = int(rows[row])
            rest = self.routes.rest(slot)
            scene = self.scenery.scene(int(self.slots.scene[slot]))
            found[row] = len(rest) > 1 and not scene.is_clear(rest)
            route.doubt[slot] = found[row]
        return found

    def _look(
        self, slot: int, place: Array, waypoint: int, goal: Array, known: bool, is_spot: bool
    ) -> None:
        """Looks for a slot's way to its goal, or to its spot beside others (`is_spot`), which may
        be nearer to a wall than a goal: its goal stays where it is.
        """
        slots, route = self.slots, self.slots.route
        (x, y), (goal_x, goal_y, goal_z) = place.tolist(), goal.tolist()
        revision = int(slots.goal_revision[slot])
        scene = self.scenery.scene(int(slots.scene[slot]))
        was_open = known and route.passage[slot] == Passage.OPEN
        route.wait[slot] = RETRY
        try:
            path = scene.path((x, y, float(slots.footing.hips[slot])), (goal_x, goal_y, goal_z))
        except Unreachable as error:
            if not known or was_open:
                kind = EventKind.BLOCKED if was_open else EventKind.UNREACHABLE
                self.tell(slot, kind, waypoint, error.text)
            route.passage[slot] = Passage.CLOSED
            route.revision[slot], route.waypoint[slot] = revision, waypoint
            route.doubt[slot] = False
            return
        if path.goal_moved > MOVED and not is_spot:
            self.move(slot, waypoint, path.points[-1])
            text = moved_text(path.goal_moved, path.goal)
            self.tell(slot, EventKind.GOAL_MOVED, waypoint, text)
        self.routes.lay(slot, path.points, revision, waypoint)


def moved_text(metres: float, place: Point3) -> Text:
    """The text for a goal that was moved."""
    return Text(
        "the goal is not on free ground; the nearest that can be reached is {} from it: {}",
        (Metres(round(metres, 2)), spot(place)),
    )
