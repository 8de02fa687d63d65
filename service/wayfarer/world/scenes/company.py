"""The effect of other people on an agent's goal and way: where it stops, and who blocks its way."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import Text
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.heading import angle_between, facing_of
from wayfarer.world.agents.slots import Feeding, Gait, Mode, Slots
from wayfarer.world.agents.velocity import SLOW
from wayfarer.world.events import EventKind
from wayfarer.world.rows import Flags, Float, Index
from wayfarer.world.scenes.collision_avoidance import CollisionAvoidance, pass_through
from wayfarer.world.scenes.detours import AHEAD, STOPS, Detours
from wayfarer.world.scenes.lanes import SIDEWAYS, lanes
from wayfarer.world.scenes.passages import COASTS, turns
from wayfarer.world.scenes.people import SessionPeople
from wayfarer.world.scenes.planner import Tell
from wayfarer.world.scenes.routes import Routes
from wayfarer.world.scenes.spots import FARTHEST, Clear, take_spots
from wayfarer.world.scenes.world_scenes import NOWHERE, WorldScenes

Array = NDArray[np.floating[Any]]

REACH: Final = 1.0
"""Distance, along its way around others, of the point that an agent on the flat floor heads for."""

TOLD: Final = 4.0
"""Seconds for which people must close a way before the event `BLOCKED` reports it."""

STUCK: Final = 10.0
"""Seconds without progress after which `BLOCKED` names the people within `NEAR` metres."""

NEAR: Final = 1.5

NAMED: Final = 8
"""Maximum number of people that the event names, the nearest to the agent."""

SHUFFLE: Final = 0.3
"""Metres added to the stopping distance of an agent that stands: it stays where it came to rest."""

PATIENCE: Final = 2.5
"""Seconds without progress after which an agent near its goal stops where it is, or asks people who
stand in its way to make way."""

BEFORE: Final = np.array([0.1, 0.4, 0.7, 1.0])
"""Metres along its way at which an agent measures the width of the way."""

TURNED: Final = 0.25
"""Radians from which shoulders count as turned."""

GOAL_MOVES: Final = 0.3
"""Metres between the goal and the end of a way around others, from which that way is dropped."""

RETURNS: Final = 1.0
"""Seconds for which people that made way remain aside once their places are in nobody's way."""

SIGHT, CLOSES, ASIDE, APART, BODY, HOME = 2.5, 0.5, 0.8, 0.46, 0.37, 0.25
"""Metres ahead of an agent within which people make way for it, metres to either side of its way
that they leave free, of a step aside, to others at its end, and beside it, and to a place that
count as being there."""

SIDES: Final = np.radians([75.0, 45.0, 105.0, 135.0])
"""Directions of a step aside, from that of the way to the side on which the person stands."""


class Company:
    """The goals and ways of a world's agents among the others of their sessions."""

    def __init__(
        self,
        slots: Slots,
        routes: Routes,
        scenery: WorldScenes,
        avoidance: CollisionAvoidance,
        tell: Tell,
    ) -> None:
        self._slots = slots
        self._routes = routes
        self._scenery = scenery
        self._avoidance = avoidance
        self._tell = tell
        self._detours = Detours(slots, routes, scenery)

    def place(self, rows: Index, hips: Float, arrived: Flags, goals: GoalColumns) -> None:
        """Puts the goals of rows [A] at `hips` [A, 2] at their spots.

        An agent that can reach no spot near enough waits there: its goal is not `given`.
        """
        slots = self._slots
        if slots.avoids[rows].any():
            waits = take_spots(
                self._avoidance.crowd, slots, rows, hips, arrived, goals, self._walls
            )
            for row in np.flatnonzero(waits).tolist():
                self._wait(int(rows[row]), self._avoidance.crowd.session(int(rows[row])))

    def make_way(
        self, rows: Index, hips: Float, gait: Gait, stays: Flags, ahead: GoalColumns
    ) -> None:
        """Makes rows [A] that `stays`, and face no heading, step aside where they close a way."""
        slots, crowd = self._slots, self._avoidance.crowd
        people, aims, memory = crowd.people, slots.aims, slots.memory
        asks = people.walks & (people.aims.barred > PATIENCE)
        stops = people.position + COASTS * people.velocity
        memory.yields[rows[stays & (gait.mode == Mode.WALKING)]] = 0.0  # it made way as it walked
        aside = memory.yields[rows] > 0
        gaps = np.linalg.norm(hips[:, None] - people.position[asks], axis=-1)
        which = stays & slots.avoids[rows] & (aside | (gaps < SIGHT + CLOSES).any(1))
        which &= ~(ahead.given & ahead.heading.any(-1)) & (slots.feeding[rows] != Feeding.EACH_STEP)
        which &= ~ahead.given | (np.linalg.norm(hips - aims.asked[rows], axis=-1) < FARTHEST)
        for row in np.flatnonzero(which).tolist():
            slot, me = int(rows[row]), int(crowd.places[rows[row]])
            some, here = slice(int(crowd.own[0][me]), int(crowd.own[1][me])), hips[row]
            home = aims.spot[slot] if aside[row] else here
            to, way = home - people.position[some], people.memory.preferred[some]
            way = way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
            on, left = (to * way).sum(-1), way[:, 0] * to[:, 1] - way[:, 1] * to[:, 0]
            goes = np.linalg.norm(people.aims.spot[some] - people.position[some], axis=-1)
            comes = (people.walks if aside[row] else asks & crowd.stand[me])[some] & (on > 0)
            comes &= (on < np.minimum(SIGHT, goes)) & (np.abs(left) < CLOSES)
            comes &= np.abs(people.height[some] - people.height[me]) < 1.0
            others = np.delete(stops[some], me - some.start, 0)
            if comes.any() and not aside[row]:
                first = int(np.where(comes, on, np.inf).argmin())
                steps = self._steps(slot, home, way[first], left[first], others)
                if not len(steps):
                    continue
                aims.spot[slot], memory.retreat[slot] = home, steps[0]
            elif not aside[row]:
                continue
            seconds = RETURNS if comes.any() else max(memory.yields[slot] - STEP_SECONDS, 0.01)
            returns = seconds < STEP_SECONDS / 2
            done = returns and np.linalg.norm(home - here) < HOME
            memory.yields[slot] = 0.0 if done else seconds
            if done:
                continue
            place = home + (not returns) * ASIDE * memory.retreat[slot]
            gaps, on = others - stops[me], place - here
            far, along = np.linalg.norm(gaps, axis=-1), gaps @ on / max(np.linalg.norm(on), 1e-6)
            before = (along > 0) & (far**2 - along**2 < BODY**2)  # such a person stops it
            ahead.given[row] = not (before & (far < APART)).any()
            ahead.through[row], ahead.strafe[row], ahead.tread[row] = False, True, 0.0
            ahead.radius[row], ahead.speed[row] = 0.1, 0.8
            ahead.position[row, :2], ahead.heading[row] = place, gait.stop_facing[row]

    def bar(
        self, rows: Index, hips: Float, led: Index, goals: GoalColumns, ahead: GoalColumns
    ) -> None:
        """Leads rows `led` around people who stand in their ways, or stops them in front.

        `rows` are their slots, `hips` [A, 2] where they are. Call it before `ahead` is bent.
        """
        which = np.flatnonzero(self._slots.avoids[rows])
        if not len(which):
            return
        some, crowd = rows[which], self._avoidance.crowd
        barred = self._detours.update(some, hips[which], goals.position[led[which]], crowd)
        if not (barred.is_barred.any() or (self._slots.memory.waited[some] > PATIENCE).any()):
            return
        rests = self._slots.planned.gait.speed[some] < SLOW
        waits = barred.is_barred & (barred.near < STOPS + SHUFFLE * rests)
        self._settle(some, hips[which], waits, goals.through[led[which]])
        ahead.given[led[which[waits]]] = False
        seconds = self._slots.aims.barred[some]
        told = barred.is_barred & (seconds >= TOLD) & (seconds < TOLD + 0.19)
        for row in np.flatnonzero(told).tolist():
            first = crowd.own[0][crowd.places[some[row]]]
            others = crowd.slots[first + np.flatnonzero(barred.by[row])]
            self._blocked(int(some[row]), others, "stand in the way, and no way leads round")
        waited = self._slots.memory.waited[some]
        stuck = ~barred.is_barred & (waited >= STUCK) & (waited < STUCK + STEP_SECONDS)
        for row in np.flatnonzero(stuck).tolist():
            everybody = crowd.session(int(some[row]))
            gaps = np.linalg.norm(everybody.people.position - hips[which[row]], axis=-1)
            others = everybody.slots[(gaps < NEAR) & (everybody.slots != some[row])]
            self._blocked(int(some[row]), others, "are in the way")

    def take_turns(
        self, rows: Index, hips: Float, led: Index, goals: GoalColumns, ahead: GoalColumns
    ) -> None:
        """Makes rows `led` wait before narrow places that others come out of; see `bar`."""
        slots, crowd = self._slots, self._avoidance.crowd
        which = self._in_scenes(rows, ahead.given[led])
        which = which[crowd.in_company(rows[which])]
        if not len(which):
            return
        some = rows[which]
        points = self._routes.ahead(some, hips[which], goals.position[led[which]], AHEAD)
        clear = self._avoidance.clearance(some)
        turn = turns(crowd.people, crowd.places[some], points, clear, crowd.own)
        way = turn.place - hips[which]
        ahead.given[led[which[turn.there]]] = False
        slots.memory.waited[some[turn.there]] += STEP_SECONDS
        aside = np.flatnonzero(turn.waits & ~turn.there)
        ahead.position[led[which[aside]], :2] = turn.place[aside]
        pass_through(ahead, led[which[aside]], way[aside])

    def keep_lanes(
        self, rows: Index, hips: Float, led: Index, goals: GoalColumns, ahead: GoalColumns
    ) -> Float:
        """Keeps rows `led` to the right in narrow ways, and turns their shoulders there.

        Returns half the width of their ways [A]; inf where nothing is known. See `bar`.
        """
        slots, crowd = self._slots, self._avoidance.crowd
        half = np.full(len(rows), np.inf, np.float32)
        which = self._in_scenes(rows, ahead.given[led])
        if not len(which):
            return half
        some = rows[which]
        points = self._routes.ahead(some, hips[which], goals.position[led[which]], BEFORE)
        clear = self._avoidance.clearance(some)
        lane = lanes(crowd.people, crowd.places[some], points, clear, crowd.own)
        half[which] = lane.half
        keeps = np.flatnonzero(lane.keeps & ahead.through[led[which]])
        ahead.position[led[which[keeps]], :2] = lane.place[keeps]
        facing = facing_of(slots.planned.seed.rotations[some, -1, 0])
        # an agent with turned shoulders turns them back before it walks on: a body drifts to
        # where it faces, which is the wall
        turned = slots.planned.gait.mode[some] == Mode.STRAFING
        turned &= angle_between(facing, lane.way) > TURNED
        sideways = (turned | (lane.turn > TURNED)) & ~ahead.strafe[led[which]]
        mine, turn = led[which[sideways]], lane.turn[sideways, None]
        way = lane.way[sideways]
        right = np.stack([way[:, 1], -way[:, 0]], -1)
        ahead.strafe[mine] = True
        ahead.heading[mine] = np.cos(turn) * way + np.sin(turn) * right
        ahead.speed[mine] = np.minimum(ahead.speed[mine], SIDEWAYS)
        return half

    def lead_on_floor(
        self, rows: Index, hips: Float, led: Index, goals: GoalColumns, ahead: GoalColumns
    ) -> None:
        """Writes next points of ways around others to rows `led` of `ahead`, on the flat floor."""
        route = self._slots.route
        around = np.flatnonzero(self._routes.is_led(rows))
        if not len(around):
            return
        some = rows[around]
        ends = self._routes.ends(some)[:, :2]
        moved = np.linalg.norm(ends - goals.position[led[around], :2], axis=-1) > GOAL_MOVES
        self._routes.forget(some[moved])
        around, some = around[~moved], some[~moved]
        if not len(around):
            return
        self._routes.follow(some, hips[around])
        target = self._routes.ahead(
            some, hips[around], goals.position[led[around]], np.array([REACH])
        )
        on = np.flatnonzero(route.length[some] - route.progress[some] > REACH)
        ahead.position[led[around[on]], :2] = target[on, 0]
        pass_through(ahead, led[around[on]], target[on, 0] - hips[around[on]])

    # Within

    def _in_scenes(self, rows: Index, given: Flags) -> Index:
        """Indices of the rows that walk in scenes among others."""
        slots = self._slots
        return np.flatnonzero(slots.avoids[rows] & (slots.scene[rows] != NOWHERE) & given)

    def _steps(self, slot: int, home: Float, way: Array, left: float, others: Array) -> Array:
        """Directions [D, 2] from `home`, `left` of a way, to free places beside that way."""
        clear, room = self._walls(slot)
        sides = np.concatenate([SIDES, -SIDES]) * (1 if left >= 0 else -1)
        steps = np.cos(sides)[:, None] * way + np.sin(sides)[:, None] * [-way[1], way[0]]
        places = home + ASIDE * steps
        free = (clear(places) >= room) & (np.abs(left + ASIDE * np.sin(sides)) >= CLOSES)
        free &= (np.linalg.norm(places[:, None] - others, axis=-1) >= APART).all(1)
        return np.asarray(steps[free])

    def _settle(self, rows: Index, hips: Float, barred: Flags, through: Flags) -> None:
        """Stops rows [A] that are near their goals and make no progress where they are."""
        aims, waited = self._slots.aims, self._slots.memory.waited[rows]
        off = np.linalg.norm(aims.asked[rows] - hips, axis=-1)
        stays = ~through & (off < FARTHEST) & (barred | (waited > PATIENCE))
        aims.spot[rows[stays]] = hips[stays]

    def _wait(self, slot: int, everybody: SessionPeople) -> None:
        """Counts how long an agent waits at a spot too far from its goal, and reports the start."""
        aims = self._slots.aims
        if aims.barred[slot] <= 0:
            gaps = np.linalg.norm(everybody.people.position - aims.asked[slot], axis=-1)
            others = everybody.slots[(gaps < FARTHEST) & everybody.stand]
            self._blocked(slot, others, "stand at the goal and leave no room")
        aims.barred[slot] += STEP_SECONDS

    def _walls(self, slot: int) -> tuple[Clear, float]:
        """The metres to the nearest wall on a slot's storey, as a function, and those it keeps."""
        number, floor = int(self._slots.scene[slot]), self._slots.footing.hips[slot]
        if number == NOWHERE:
            return (lambda points: np.full(len(points), np.inf)), 0.0
        scene = self._scenery.scene(number)
        return (
            lambda points: scene.distance(np.column_stack([points, np.full(len(points), floor)])),
            scene.spec.walkable.radius,
        )

    def _blocked(self, slot: int, others: Index, why: str) -> None:
        slots = self._slots
        place = slots.planned.seed.translation[:, -1, :2]
        away = np.linalg.norm(place[others] - place[slot], axis=-1)
        nearest = others[np.argsort(away, kind="stable")]
        names = [str(name) for name in slots.agent_id[nearest[:NAMED]]]
        more = len(nearest) - len(names)
        text = ", ".join(names) + (f" and {more} more" if more else "")
        waypoint = int(slots.planned.gait.waypoint[slot])
        self._tell(
            slot, EventKind.BLOCKED, waypoint, Text(f"{text or 'others'} {why}; the agent waits")
        )
