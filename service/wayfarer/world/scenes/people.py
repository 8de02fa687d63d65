"""Agents in the form that avoidance uses: those of a session, all at one moment."""

from functools import cache
from math import sqrt
from typing import Any, Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, warm
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.world.agents.route import Passage
from wayfarer.world.agents.slots import Mode, Slots
from wayfarer.world.agents.velocity import FORESIGHT, SLOW
from wayfarer.world.avoidance.people import People
from wayfarer.world.rows import Flags, Float, Index, Int, Int8
from wayfarer.world.scenes.cells import Cells, beside, bisect, cells_of
from wayfarer.world.scenes.world_scenes import NOWHERE

RADIUS: Final = 0.22
"""Radius of a person among others in metres."""

PRESSED: Final = 1.5
"""Metres: an agent is in a crowd if another one walks within these."""

OPEN, WALKING = int(Passage.OPEN), int(Mode.WALKING)


class SessionPeople(NamedTuple):
    """All people of a session."""

    people: People
    slots: Index  # ascending
    stand: Flags  # agents that stand and have no way to go

    def rows(self, slots: Index) -> Index:
        """Rows of some of them in `people`."""
        return np.searchsorted(self.slots, slots)

    def level(self, me: int) -> Flags:
        """Which of them are others on the floor of person `me`."""
        near: Flags = np.abs(self.people.height - self.people.height[me]) < 1.0
        return near & (np.arange(len(near)) != me)


class Gathering(NamedTuple):
    """All people of some sessions, one session after the other."""

    people: People
    slots: Index  # ascending within a session
    own: tuple[Index, Index]  # [N] first row and last of everybody's session
    stand: Flags  # [N] as in `SessionPeople`
    places: Index  # of all slots, where they stand in `people`
    cells: Cells

    def in_company(self, slots: Index) -> Flags:
        """Which of some slots are not alone in their session."""
        first, last = self.own
        rows = self.places[slots]
        found: Flags = last[rows] - first[rows] > 1
        return found

    def near(self, slots: Index, those: Flags, within: float) -> Flags:
        """Which of some slots have another of `those` [N] within some metres, fewer than `CELL`."""
        them, me, first = self.people, self.places[slots], self.own[0]
        found: Flags = find_near(me, first, self.cells, them.position, them.height, those, within)
        return found

    def session(self, slot: int) -> SessionPeople:
        """Everybody of the session of a slot."""
        row = self.places[slot]
        first, last = int(self.own[0][row]), int(self.own[1][row])
        return SessionPeople(
            self.people.part(first, last), self.slots[first:last], self.stand[first:last]
        )


class PeopleColumns(NamedTuple):
    """Columns of `People` [N], for compiled rules, and everybody's session."""

    first: Index  # first row of everybody's session
    last: Index  # the row after its last one
    number: Int
    position: Float
    height: Float
    velocity: Float
    walks: Flags
    wants: Flags
    preferred: Float
    spot: Float
    waited: Float

    @classmethod
    def of(cls, people: People, own: tuple[Index, Index] | None = None) -> "PeopleColumns":
        """The columns of some people. `own`: the sessions; None: all are of one."""
        count, aims, memory = len(people.number), people.aims, people.memory
        first, last = own or (np.zeros(count, np.int64), np.full(count, count))
        return cls(
            *(first, last, people.number, people.position, people.height, people.velocity),
            *(people.walks, aims.wants, memory.preferred, aims.spot, memory.waited),
        )


class SlotArrays(NamedTuple):
    """The columns of all slots that a gathering is made of."""

    active: Flags
    session: Int
    scene: Int
    frame: Int  # at which what is planned ends
    hips: Float
    speed: Float
    mode: Int8
    arrived: Flags
    wants: Flags
    goal_revision: Int
    revision: Int
    passage: Int8


def crowd_of(slots: Slots, rows: Index) -> Gathering:
    """Everybody of the sessions of `rows`, which are about to be stepped.

    Agents are planned to different moments; they are carried on to that of their session's `rows`.
    """
    found, own, places, stand, place, height, velocity, walks = _gather(_arrays(slots), rows)
    people = People(
        number=slots.alias[found],
        group=slots.group[found],
        position=place,
        height=height,
        velocity=velocity,
        walks=walks,
        radius=np.full(len(found), RADIUS, np.float32),
        memory=slots.planned.memory.take(found),
        aims=slots.planned.aims.take(found),
    )
    return Gathering(people, found, own, stand, places, cells_of(own[0], place))


def _arrays(slots: Slots) -> SlotArrays:
    seed, gait = slots.planned.seed, slots.planned.gait
    return SlotArrays(
        slots.active,
        slots.session,
        slots.scene,
        slots.start_frame + NEW_FRAMES * slots.planned_chunks,
        seed.translation,
        gait.speed,
        gait.mode,
        gait.arrived,
        slots.planned.aims.wants,
        slots.goal_revision,
        slots.route.revision,
        slots.route.passage,
    )


@compiled
def _gather(slots: SlotArrays, rows: Index) -> tuple[Any, ...]:
    """Columns of `Gathering` and `People`."""
    sessions, moments = np.empty(len(rows) + 1, np.int64), np.empty(len(rows), np.int64)
    known = 0
    for row in rows:
        session, frame = slots.session[row], slots.frame[row]
        at = bisect(sessions, known, session)
        if at == known or sessions[at] != session:
            for k in range(known, at, -1):
                sessions[k], moments[k] = sessions[k - 1], moments[k - 1]
            sessions[at], moments[at] = session, frame
            known += 1
        moments[at] = max(moments[at], frame)
    of, ends = np.full(len(slots.active), -1), np.zeros(known + 1, np.int64)
    for slot in range(len(of)):
        if slots.active[slot]:
            at = bisect(sessions, known, slots.session[slot])
            if at < known and sessions[at] == slots.session[slot]:
                of[slot] = at
                ends[at + 1] += 1
    for at in range(known):
        ends[at + 1] += ends[at]
    count, begins, places = ends[known], ends.copy(), np.zeros(len(of), np.int64)
    found, first, last = (
        np.empty(count, np.int64),
        np.empty(count, np.int64),
        np.empty(count, np.int64),
    )
    place, velocity = np.empty((count, 2), np.float32), np.empty((count, 2), np.float32)
    height, walks, stand = (
        np.empty(count, np.float32),
        np.empty(count, np.bool_),
        np.empty(count, np.bool_),
    )
    for slot in range(len(of)):
        if of[slot] < 0:
            continue
        at = of[slot]
        row, end = begins[at], slots.hips.shape[1] - 1
        begins[at] += 1
        places[slot], found[row], first[row], last[row] = row, slot, ends[at], ends[at + 1]
        x = slots.hips[slot, end, 0] - slots.hips[slot, 0, 0]
        y = slots.hips[slot, end, 1] - slots.hips[slot, 0, 1]
        speed = slots.speed[slot] if slots.speed[slot] >= np.float32(SLOW) else np.float32(0)
        speed /= max(np.float32(sqrt(x * x + y * y)), np.float32(1e-6))
        velocity[row, 0], velocity[row, 1] = x * speed, y * speed
        ahead = min(max((moments[at] - slots.frame[slot]) / FPS, -FORESIGHT), FORESIGHT)
        for k in range(2):
            place[row, k] = slots.hips[slot, end, k] + velocity[row, k] * ahead
        height[row] = slots.hips[slot, end, 2]
        opened = slots.revision[slot] == slots.goal_revision[slot] and slots.passage[slot] == OPEN
        goes = slots.wants[slot] and not slots.arrived[slot]
        goes = goes and (opened or slots.scene[slot] == NOWHERE)
        walks[row] = goes or slots.mode[slot] == WALKING
        stand[row] = not walks[row] and velocity[row, 0] == 0 and velocity[row, 1] == 0
    return found, (first, last), places, stand, place, height, velocity, walks


@compiled
def find_near(
    mine: Index,
    first: Index,
    cells: Cells,
    place: Float,
    height: Float,
    those: Flags,
    within: float,
) -> Flags:
    """See `Gathering.near`."""
    found = np.zeros(len(mine), np.bool_)
    for row in range(len(mine)):
        me = mine[row]
        for side in range(-1, 2):
            begin, end = beside(cells, first[me], place[me, 0], place[me, 1], side)
            for k in range(begin, end):
                other = cells.rows[k]
                x, y = place[other, 0] - place[me, 0], place[other, 1] - place[me, 1]
                if other != me and those[other] and x * x + y * y < within * within:
                    found[row] = found[row] or abs(height[other] - height[me]) < 1.0
    return found


@cache
def prepare() -> None:
    """Compiles the rule, or loads it, before agents walk."""
    row, flag, place = np.zeros(1, np.int64), np.zeros(1, np.bool_), np.zeros((1, 2), np.float32)
    warm(_gather, _arrays(Slots.empty(1)), row)
    warm(find_near, row, row, cells_of(row, place), place, place[0, :1], flag, PRESSED)
