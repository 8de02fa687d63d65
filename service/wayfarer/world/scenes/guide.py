"""The guide of a world: ways around walls, and of people around each other."""

from dataclasses import replace
from typing import Final

import numpy as np

from wayfarer.engines.engine import Float, no_obstacles
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.route import Passage
from wayfarer.world.agents.slots import Motion, Seeds, Slots
from wayfarer.world.agents.velocity import moving
from wayfarer.world.goals.gait_rules import GoalArrays
from wayfarer.world.rows import Array, Flags, Index, columns
from wayfarer.world.scenes.collision_avoidance import CollisionAvoidance
from wayfarer.world.scenes.company import Company
from wayfarer.world.scenes.grounding import is_level
from wayfarer.world.scenes.leads import LINE, METRES, TRIED, Space, lead_rows, look_along
from wayfarer.world.scenes.making_way import MakingWay
from wayfarer.world.scenes.nearest_obstacles import nearest_people, nearest_walls
from wayfarer.world.scenes.people import PRESSED
from wayfarer.world.scenes.planner import Planner, Tell
from wayfarer.world.scenes.routes import Routes
from wayfarer.world.scenes.world_scenes import NOWHERE, WorldScenes
from wayfarer.world.stepping.guide import NextTarget

STRAYED: Final = 1.0
"""Metres outside the radius of a goal, once reached, from which an agent walks back to it."""

DETOUR: Final = 1.0
"""Metres outside the radius of a goal, along the way, from which it cannot have been reached."""

STAIRS: Final = np.arange(-0.45, 0.86, 0.05)
"""Metres along the way, starting behind the agent, at which stairs are looked for."""

RISER: Final = (0.08, 0.35)
"""Height difference (m) between two of these points where there is a riser."""

TREAD: Final = (0.2, 0.6)
"""Metres from riser to riser where risers form stairs."""

STAIRS_SPEED: Final = 0.9
"""Maximum m/s on stairs."""

SLOPES: Final = (0.15, 0.45)
SLOPE_SPEED: Final = (1.5, 0.8)
"""Maximum m/s on slopes as steep (rise over run, up or down), linear in between."""


class SceneGuide:
    """Implements `Guide`."""

    def __init__(
        self, slots: Slots, routes: Routes, scenery: WorldScenes, planner: Planner, tell: Tell
    ) -> None:
        self._slots = slots
        self._routes = routes
        self._scenery = scenery
        self._planner = planner
        self.avoidance = CollisionAvoidance(slots, scenery)
        self.company = Company(slots, routes, scenery, self.avoidance, tell)
        self.making_way = MakingWay(slots, scenery, self.avoidance)

    def course(self, rows: Index, start: Motion, goals: GoalColumns) -> NextTarget:
        """See `Guide`."""
        self.avoidance.look(rows)
        hips = np.ascontiguousarray(start.seed.translation[:, -1, :2])
        self.company.place(rows, hips, start, goals)
        in_scene = self._slots.scene[rows] != NOWHERE
        if not in_scene.any():
            return self._on_floor(rows, hips, start, goals)
        if in_scene.all():
            return self._led(rows, hips, start, goals)
        ahead = goals.take(np.arange(len(rows)))
        radius = goals.radius.copy()
        for which, lead in ((in_scene, self._led), (~in_scene, self._on_floor)):
            mine = np.flatnonzero(which)
            if len(mine):
                part = start.take(mine)
                led = lead(rows[mine], hips[mine], part, goals.take(mine))
                start.put(mine, part)
                ahead.put(mine, led.ahead)
                radius[mine] = led.judged.radius
        return NextTarget(ahead, replace(goals, radius=radius))

    def obstacles(self, rows: Index, seed: Seeds) -> Float:
        """See `Guide`."""
        found = no_obstacles(len(rows))
        scenes = self._slots.scene[rows]
        if not (scenes.any() or self._slots.avoids[rows].any()):
            return found
        half = found.shape[1] // 2
        if scenes.any():
            hips = seed.translation[:, -1, :2]
            velocity = moving(seed.translation, self._slots.planned.gait.speed[rows])
            floors = self._slots.footing.hips[rows]
        for number in set(scenes[scenes != NOWHERE].tolist()):
            mine = np.flatnonzero(scenes == number)
            scene = self._scenery.scene(number)
            found[mine, :half] = nearest_walls(
                scene, hips[mine], velocity[mine], floors[mine], half
            )
        avoiding = np.flatnonzero(self._slots.avoids[rows])
        nearest_people(self.avoidance.crowd, rows[avoiding], avoiding, half, found)
        return found

    # Within

    def _on_floor(self, rows: Index, hips: Array, start: Motion, goals: GoalColumns) -> NextTarget:
        """The targets of rows on the flat floor without a scene; see `course`."""
        ahead = goals.take(np.arange(len(rows)))
        wanted = goals.given & ~start.gait.arrived
        _begin(start, wanted)
        led = np.flatnonzero(wanted & self._slots.avoids[rows])
        if len(led):
            some, places = rows[led], hips[led]
            self.company.lead_on_floor(some, places, led, goals, ahead)
            self._go_among_others(some, places, led, start, goals, ahead)
        self.company.stand_close(rows, ahead)
        self.making_way.update(rows, hips, start, ~wanted, ahead)
        return NextTarget(ahead, goals)

    def _go_among_others(
        self,
        rows: Index,
        hips: Array,
        led: Index,
        start: Motion,
        goals: GoalColumns,
        ahead: GoalColumns,
    ) -> None:
        self.company.bar(rows, hips, led, start, goals, ahead)
        self.company.take_turns(rows, hips, led, goals, ahead)
        width = self.company.keep_lanes(rows, hips, led, goals, ahead)
        self.avoidance.bend(rows, hips, led, start.memory, goals, ahead, width)

    def _led(self, rows: Index, hips: Array, start: Motion, goals: GoalColumns) -> NextTarget:
        """The targets of rows that are all in scenes; see `course`."""
        route, gait = self._slots.route, start.gait
        away = np.linalg.norm(goals.position[:, :2] - hips, axis=-1)
        back = ~goals.through & (away > goals.radius + STRAYED) & (start.memory.yields <= 0)
        wanted = goals.given & (~gait.arrived | back)
        _begin(start, wanted)
        self._planner.update(rows, hips, start, goals, wanted)
        known = (route.revision[rows] == self._slots.goal_revision[rows]) & (
            route.waypoint[rows] == gait.waypoint
        )
        open_ = known & (route.passage[rows] == Passage.OPEN)
        ahead, radius = goals.take(np.arange(len(rows))), goals.radius.copy()
        ahead.given &= open_ | ~wanted
        left = np.where(open_, route.length[rows] - route.progress[rows], np.inf)
        radius[wanted & (left > goals.radius + DETOUR)] = -1.0
        led = np.flatnonzero(wanted & open_)
        if len(led):
            self._lead(rows[led], hips[led], led, ahead)
            self._go_among_others(rows[led], hips[led], led, start, goals, ahead)
        self.company.stand_close(rows, ahead)
        self.making_way.update(rows, hips, start, ~wanted, ahead)
        return NextTarget(ahead, replace(goals, radius=radius))

    def _lead(self, rows: Index, hips: Float, led: Index, ahead: GoalColumns) -> None:
        """Writes the next points of their ways to rows `led` of `ahead`."""
        route, count = self._slots.route, len(rows)
        progress, length = route.progress[rows][:, None], route.length[rows][:, None]
        metres = np.minimum(progress + METRES, length)
        points = self._routes.at(rows, metres)
        lines = np.empty((count, TRIED * len(LINE), 3))
        look_along(hips, points, lines)
        near, away = self._scenery.clearance(rows, hips)
        space = Space(
            self._scenery.distance(rows, lines),
            near,
            away,
            self._scenery.radius(rows),
            self._crowded(rows),
        )
        steers = columns(GoalArrays, ahead)
        lead_rows(hips, led, points, metres >= length - np.float32(1e-6), space, steers)
        self._slow_on_stairs(rows, led, ahead)

    def _slow_on_stairs(self, rows: Index, led: Index, ahead: GoalColumns) -> None:
        """Writes treads, and speeds on stairs and slopes, to rows `led` of `ahead`."""
        route, numbers = self._slots.route, self._slots.scene[rows]
        for number in set(numbers.tolist()):
            scene = self._scenery.scene(number)
            if is_level(scene):
                continue
            mine = np.flatnonzero(numbers == number)
            agents = rows[mine]
            here, length = route.progress[agents][:, None], route.length[agents][:, None]
            metres = np.clip(here + STAIRS, 0.0, length)
            points = self._routes.at(agents, metres)
            points[..., 2] = self._slots.footing.hips[agents][:, None]
            tread, slope = stairs_of(scene.floor(points), metres)
            speed = np.interp(slope, SLOPES, SLOPE_SPEED)
            speed = np.where(tread > 0, STAIRS_SPEED, speed)
            ahead.tread[led[mine]] = tread
            ahead.speed[led[mine]] = np.minimum(ahead.speed[led[mine]], speed)

    def _crowded(self, rows: Index) -> Flags:
        """Which rows walk in a crowd [A]."""
        avoids = self._slots.avoids[rows]
        found = np.zeros(len(rows), np.bool_)
        if avoids.any():
            crowd = self.avoidance.crowd
            found[avoids] = crowd.near(rows[avoids], crowd.people.walks, PRESSED)
        return found


def _begin(start: Motion, wanted: Flags) -> None:
    """Notes which rows [A] have a way to go, and for how long. An agent that begins or ends a way
    no longer makes way.
    """
    turned, aims = wanted != start.aims.wants, start.aims
    start.memory.yields[turned] = aims.stuck[turned] = aims.advanced[turned] = 0.0
    aims.stuck[wanted] += np.float32(STEP_SECONDS)
    aims.wants = wanted


def stairs_of(heights: Array, metres: Array) -> tuple[Array, Array]:
    """Treads and slopes of floors: heights [A, P] at `metres` [A, P] along ways.

    Returns metres from riser to riser [A], 0 without stairs; and the steepest slope [A] beside
    them, rise over run.
    """
    steps = np.abs(np.diff(heights, axis=1))
    risers = (steps > RISER[0]) & (steps < RISER[1])
    count = risers.sum(1)
    middles = (metres[:, 1:] + metres[:, :-1]) / 2
    first = np.where(risers, middles, np.inf).min(1)
    last = np.where(risers, middles, -np.inf).max(1)
    tread = np.where(count > 1, last - first, 0.0) / np.maximum(count - 1, 1)
    tread = np.where((tread > TREAD[0]) & (tread < TREAD[1]), tread, 0.0)
    run = metres[:, -1] - metres[:, 0]
    slope = np.abs(heights[:, -1] - heights[:, 0]) / np.maximum(run, 0.3)
    return tread, np.where(count > 0, 0.0, slope)
