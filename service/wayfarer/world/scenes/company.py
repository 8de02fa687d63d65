"""The effect of other people on an agent's goal and way: where it stops, and who blocks its way."""

from typing import Final

import numpy as np

from wayfarer.errors import Text
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.heading import angle_between, facing_of
from wayfarer.world.agents.slots import Mode, Motion, Slots
from wayfarer.world.agents.velocity import SLOW
from wayfarer.world.avoidance.kernel import Width
from wayfarer.world.avoidance.people import Aims
from wayfarer.world.events import EventKind
from wayfarer.world.rows import Flags, Float, Index
from wayfarer.world.scenes.collision_avoidance import CollisionAvoidance, pass_through
from wayfarer.world.scenes.detours import AHEAD, STOPS, Detours
from wayfarer.world.scenes.lanes import SIDEWAYS, lanes
from wayfarer.world.scenes.passages import turns
from wayfarer.world.scenes.planner import Tell
from wayfarer.world.scenes.routes import Routes
from wayfarer.world.scenes.spots import FARTHEST, take_spots
from wayfarer.world.scenes.world_scenes import NOWHERE, WorldScenes

REACH: Final = 1.0
"""Distance, along its way around others, of the point that an agent on the flat floor heads for."""

REPORT_S: Final = 4.0
"""Seconds for which people must close a way before the event `BLOCKED` reports it."""

PACE: Final = 0.2
"""Metres per second along its way below which an agent falls behind. A step aside, or back and
forth, is no progress."""

STUCK: Final = 8.0
"""Seconds by which it falls behind until `BLOCKED` names the people within `NEAR` metres; then the
count begins again. An agent that comes forward by less than .4 m in ten seconds gets the event
within these."""

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

TOUCH: Final = 0.4
"""Metres between the places of two standing people within which their bodies are in each other."""

CLOSE: Final = 0.62
"""Metres to another one within which a standing agent does not shift its weight: the width of a
body, and what two shift towards each other."""

TURNED: Final = 0.25
"""Radians from which shoulders count as turned."""

GOAL_MOVES: Final = 0.3
"""Metres between the goal and the end of a way around others, from which that way is dropped."""


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

    def place(self, rows: Index, hips: Float, start: Motion, goals: GoalColumns) -> None:
        """Puts the goals of rows [A] at `hips` [A, 2] at their spots.

        An agent that can reach no spot near enough waits there: its goal is not `given`.
        """
        slots = self._slots
        if slots.avoids[rows].any():
            waits = take_spots(
                self._avoidance.crowd, slots, rows, hips, start, goals, self._scenery.walls
            )
            for row in np.flatnonzero(waits).tolist():
                self._wait(int(rows[row]), start.aims.part(row, row + 1))

    def bar(
        self,
        rows: Index,
        hips: Float,
        led: Index,
        start: Motion,
        goals: GoalColumns,
        ahead: GoalColumns,
    ) -> None:
        """Leads rows `led` around people who stand in their ways, or stops them in front.

        `rows` are their slots, `hips` [A, 2] where they are. Call it before `ahead` is bent.
        """
        which = np.flatnonzero(self._slots.avoids[rows])
        if not len(which):
            return
        some, mine, crowd = rows[which], led[which], self._avoidance.crowd
        places, aims, waited = goals.position[mine], start.aims, start.memory.waited[mine]
        barred = self._detours.update(some, hips[which], places, crowd, aims.barred[mine])
        aims.barred[mine] = seconds = barred.seconds.astype(np.float32)
        reported = barred.is_barred & (seconds >= REPORT_S) & (seconds < REPORT_S + 0.19)
        stuck = self._count_progress(some, hips[which], mine, aims, ahead)
        aims.stuck[mine[reported]] = 0.0
        for row in np.flatnonzero(stuck & ~reported).tolist():
            everybody = crowd.session(int(some[row]))
            gaps = np.linalg.norm(everybody.people.position - hips[which[row]], axis=-1)
            others = everybody.slots[(gaps < NEAR) & (everybody.slots != some[row])]
            self._blocked(int(some[row]), others, "are in the way")
        if not (barred.is_barred.any() or (waited > PATIENCE).any()):
            return
        rests = start.gait.speed[mine] < SLOW
        waits = barred.is_barred & (barred.near < STOPS + SHUFFLE * rests)
        off = np.linalg.norm(aims.asked[mine] - hips[which], axis=-1)
        stays = ~goals.through[mine] & (off < FARTHEST) & (waits | (waited > PATIENCE))
        # it makes no progress, and stops where it is if it is in nobody there
        stays[stays] = ~crowd.near(some[stays], crowd.stand, TOUCH)
        aims.spot[mine[stays]] = hips[which[stays]]
        ahead.given[mine[waits]] = False  # it asks the nearest one to make way
        ahead.position[mine[waits], :2] = crowd.people.position[barred.first[waits]]
        for row in np.flatnonzero(reported).tolist():
            first = crowd.own[0][crowd.places[some[row]]]
            others = crowd.slots[first + np.flatnonzero(barred.by[row])]
            self._blocked(int(some[row]), others, "stand in the way, and no way leads round")

    def take_turns(
        self, rows: Index, hips: Float, led: Index, goals: GoalColumns, ahead: GoalColumns
    ) -> None:
        """Makes rows `led` wait before narrow places that others come out of; see `bar`."""
        crowd = self._avoidance.crowd
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
        aside = np.flatnonzero(turn.waits & ~turn.there)
        ahead.position[led[which[aside]], :2] = turn.place[aside]
        pass_through(ahead, led[which[aside]], way[aside])

    def keep_lanes(
        self, rows: Index, hips: Float, led: Index, goals: GoalColumns, ahead: GoalColumns
    ) -> Width:
        """Keeps rows `led` to the right in narrow ways, and turns their shoulders there.

        Returns the width of their ways [A]. See `bar`.
        """
        slots, crowd = self._slots, self._avoidance.crowd
        width = Width(*np.full((2, len(rows)), np.inf, np.float32))
        which = self._in_scenes(rows, ahead.given[led])
        if not len(which):
            return width
        some = rows[which]
        points = self._routes.ahead(some, hips[which], goals.position[led[which]], BEFORE)
        clear = self._avoidance.clearance(some)
        lane = lanes(crowd.people, crowd.places[some], points, clear, crowd.own)
        width.most[which], width.least[which] = lane.width
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
        return width

    def stand_close(self, rows: Index, ahead: GoalColumns) -> None:
        """Notes which rows have somebody within `CLOSE`."""
        which = np.flatnonzero(self._slots.avoids[rows])
        if len(which):
            crowd = self._avoidance.crowd
            ahead.close[which] = crowd.near(rows[which], np.ones_like(crowd.stand), CLOSE)

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

    def _count_progress(
        self, rows: Index, hips: Float, mine: Index, aims: Aims, ahead: GoalColumns
    ) -> Flags:
        """Notes in rows `mine` of `aims` how far rows [A] at `hips` [A, 2] have got on to their
        places `ahead`. Returns which have fallen too far behind; their count begins again.
        """
        way = ahead.position[mine, :2] - hips
        crowd, step = self._avoidance.crowd, np.float32(STEP_SECONDS)
        gone = step * crowd.people.velocity[crowd.places[rows]] * way
        far = np.maximum(np.hypot(way[:, 0], way[:, 1]), np.float32(1e-6))
        advanced = aims.advanced[mine] + (gone[:, 0] + gone[:, 1]) / far
        seconds = aims.stuck[mine] - np.maximum(advanced, 0) / np.float32(PACE)
        is_stuck: Flags = seconds >= STUCK
        aims.advanced[mine] = np.minimum(advanced, 0)
        aims.stuck[mine] = np.where(is_stuck, 0, np.maximum(seconds, 0))
        return is_stuck

    def _wait(self, slot: int, aims: Aims) -> None:
        """Counts how long an agent waits at a spot too far from its goal. It is reported at the
        start and every `STUCK` seconds. The first report is left out if `BLOCKED` has just said
        that the way there is closed.

        `aims`: the agent's own, one row.
        """
        if not REPORT_S <= aims.barred[0] < REPORT_S + STUCK:
            everybody = self._avoidance.crowd.session(slot)
            gaps = np.linalg.norm(everybody.people.position - aims.asked[0], axis=-1)
            others = everybody.slots[(gaps < FARTHEST) & everybody.stand]
            self._blocked(slot, others, "stand at the goal and leave no room")
            aims.barred[0] = REPORT_S
        aims.barred[0] += STEP_SECONDS

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
