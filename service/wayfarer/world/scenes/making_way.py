"""Making way: a standing agent steps aside when another is stuck before it or waits in its place,
and returns when its place is free. If it is in the way where it stepped, it steps again, but never
too far from its goal. If there is no room beside the way, it steps on along it. If two agents stand
or wait in each other, the one with the higher number steps aside, and a standing one always does so
for a waiting one. A step leads through nobody.

`Memory.yields` counts the seconds until it returns, `Aims.spot` is the place that it left,
`Memory.retreat` the way from there to where it steps, in `ASIDE`. World's frame, metres.
"""

from functools import cache
from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Feeding, Motion, Slots
from wayfarer.world.avoidance.people import Memory, People
from wayfarer.world.output.turns import apart
from wayfarer.world.rows import Array, Flags, Float, Index, Int
from wayfarer.world.scenes.cells import Cells, beside, cells_of
from wayfarer.world.scenes.collision_avoidance import CollisionAvoidance
from wayfarer.world.scenes.company import PATIENCE, TOUCH
from wayfarer.world.scenes.passages import COASTS
from wayfarer.world.scenes.people import Gathering
from wayfarer.world.scenes.spots import FARTHEST
from wayfarer.world.scenes.world_scenes import WorldScenes

SIGHT: Final = 2.5
"""Metres ahead of an agent within which people make way for it."""

CLOSES: Final = 0.5
"""Metres to either side of its way within which a person closes it."""

ASIDE: Final = 0.8
"""Metres of a step aside."""

SIDES: Final = np.radians([75, 45, 105, 135, -75, -45, -105, -135])
STEPS: Final = np.concatenate(
    [s * np.stack([np.cos(SIDES), np.sin(SIDES)], 1) for s in (1, 0.6)]
    + [np.array([(1, 0), (0.6, 0), (-1, 0), (-0.6, 0)])]
)
"""Such steps [S, 2], and shorter ones: along a way, and to the side on which the person stands. The
ones along the way leave it closed, but lead out of another one, beside a wall, too."""

ON: Final = (STEPS[:, 0] > 0) & (STEPS[:, 1] == 0)
"""Which of them lead on along the way: a person that cannot leave it walks before the other."""

APART: Final = 0.46
"""Metres that a step leaves between two people."""

BODY, NEARER = 0.37, 0.9
"""Metres beside the line of a step within which somebody stops it, or that share of the distance to
that one: a step leads out of another one, not through it."""

ROOMIER: Final = 0.05
"""Metres of more room that make a step out of another one worthwhile where no place is free."""

RETURNS: Final = 1.0
"""Seconds for which people remain aside once their places are in nobody's way."""

HOME: Final = 0.25
"""Metres from its place within which a person is back."""


NEIGHBOURS: Final = 1.5
"""Metres from a person and its place within which others matter to its step."""


class Neighbours(NamedTuple):
    """Everybody of some sessions [N], for compiled rules."""

    first: Index  # [N] first row and last of everybody's session
    last: Index
    cells: Cells
    number: Int
    position: Float
    height: Float
    velocity: Float
    walks: Flags
    stand: Flags
    asks: Flags  # it is stuck
    preferred: Float
    spot: Float

    @classmethod
    def of(cls, crowd: Gathering) -> "Neighbours":
        """The people of a gathering."""
        people = crowd.people
        return cls(
            *crowd.own,
            crowd.cells,
            people.number,
            people.position,
            people.height,
            people.velocity,
            people.walks,
            crowd.stand,
            is_stuck(people),
            people.memory.preferred,
            people.aims.spot,
        )


class Asks(NamedTuple):
    """Whom some people [A] step aside for: a row of everybody, or -1."""

    touches: Index  # the nearest at rest that is still where the person stands
    asks: Index  # the nearest that is stuck since the person closes its way
    comes: Index  # the nearest whose way a person that has stepped aside would close at its place
    way: Float  # [A, 2] unit vector: that one's way, or one through the first, past the person
    left: Float  # [A] metres from that way to the person, to the left

    @classmethod
    def empty(cls, count: int) -> "Asks":
        """Nobody."""
        touches, asks, comes = np.full((3, count), -1)
        way, left = np.zeros((count, 2), np.float32), np.zeros(count, np.float32)
        return cls(touches, asks, comes, way, left)


class MakingWay:
    """The people of a world that step aside for others."""

    def __init__(self, slots: Slots, scenery: WorldScenes, avoidance: CollisionAvoidance) -> None:
        self._slots = slots
        self._scenery = scenery
        self._avoidance = avoidance

    def update(
        self, rows: Index, hips: Float, start: Motion, stays: Flags, ahead: GoalColumns
    ) -> None:
        """Writes to `ahead` where rows [A] at `hips` [A, 2] step: aside, or back. A row that waits
        on its way (not `stays`) steps out of another agent.
        """
        gait, memory, spots = start.gait, start.memory, start.aims.spot
        crowd = self._avoidance.crowd
        which = np.flatnonzero((stays | ~ahead.given) & self._may_step(rows, hips, start, ahead))
        if not len(which):
            return
        mine, aside = crowd.places[rows[which]], stays[which] & (memory.yields[which] > 0)
        has_place = aside | (np.linalg.norm(spots[which] - hips[which], axis=-1) < HOME)
        homes = np.where(has_place[:, None], spots[which], hips[which])
        asks, everybody = Asks.empty(len(which)), Neighbours.of(crowd)
        find_asks(everybody, mine, hips[which], homes, stays[which], aside, asks)
        is_asked = (asks.touches >= 0) | (asks.asks >= 0)
        for at in np.flatnonzero(is_asked | aside).tolist():
            row, here, home, me = which[at], hips[which[at]], homes[at], mine[at]
            others = find_stops(everybody, me, here, home)
            stop = everybody.position[me] + np.float32(COASTS) * everybody.velocity[me]
            step, runs_on = None, are_stopped(here, stop[None], others)[0]
            if is_asked[at] and not runs_on:
                way = asks.way[at], asks.left[at], asks.touches[at] >= 0
                goal = start.aims.asked[row] if ahead.given[row] else here
                step = self._step(int(rows[row]), here, goal, *way, others)
            if step is not None:
                place, retreat = here + ASIDE * step, step + (here - home) / ASIDE
            elif not aside[at]:
                continue
            if stays[row]:
                if step is not None:
                    spots[row], memory.retreat[row] = home, retreat
                taken = bool((np.linalg.norm(others - spots[row], axis=-1) < TOUCH).any())
                # an agent in the way that can step no farther is better off at its place
                needed = taken or step is not None or asks.comes[at] >= 0
                place = next_place(memory, row, here, spots[row], needed)
            if not stays[row] or memory.yields[row] > 0:
                ahead.given[row] = not (runs_on or are_stopped(here, place[None], others)[0])
                ahead.through[row], ahead.strafe[row], ahead.tread[row] = False, True, 0.0
                ahead.radius[row], ahead.speed[row] = 0.1, 0.8
                ahead.position[row, :2], ahead.heading[row] = place, gait.stop_facing[row]

    def _may_step(self, rows: Index, hips: Float, start: Motion, ahead: GoalColumns) -> Flags:
        """Which of rows [A] at `hips` [A, 2] may step: they face no heading, and are near their
        goal, if they have any.
        """
        slots = self._slots
        at_goal = np.linalg.norm(hips - start.aims.asked, axis=-1) < FARTHEST
        at_goal |= start.memory.yields > 0  # it has stepped from there
        free = ~ahead.given | (at_goal & ~ahead.heading.any(-1))
        may: Flags = free & slots.avoids[rows] & (slots.feeding[rows] != Feeding.EACH_STEP)
        return may

    def _step(
        self,
        slot: int,
        here: Float,
        goal: Float,
        way: Array,
        left: float,
        touches: bool,
        others: Array,
    ) -> Array | None:
        """A slot's step, in `ASIDE`, from `here` [2], `left` of a way [2], to a free place to which
        nobody stops it, near its `goal` [2]. Neighbours would come to a stand at `others` [N, 2].

        A person that cannot leave the way steps on along it. A person that `touches` another need
        not leave it. If no place is free, it takes the one with the most room, if that is more
        than it has.
        """
        clear, wide = self._scenery.walls(slot)
        tried = STEPS * [1, 1 if left >= 0 else -1]
        steps = tried @ np.array([way, [-way[1], way[0]]])
        places = here + ASIDE * steps
        may = touches | ON | (np.abs(left + ASIDE * tried[:, 1]) >= CLOSES)
        may &= np.linalg.norm(places - goal, axis=-1) < FARTHEST
        may &= (clear(places) >= wide) & ~are_stopped(here, places, others)
        gaps = np.linalg.norm(np.append(places, here[None], 0)[:, None] - others, axis=-1)
        rooms = gaps.min(1, initial=np.inf)
        room, least = np.where(may, rooms[:-1], 0.0), APART
        if touches:
            least = min(APART, max(rooms[-1] + ROOMIER, room.max() - ROOMIER))
        free = room >= least
        return steps[free.argmax()] if free.any() else None


def next_place(memory: Memory, row: int, here: Float, home: Float, needed: bool) -> Float:
    """Where a person steps to [2]; counts the seconds since its `home` was last `needed`."""
    seconds = RETURNS if needed else max(memory.yields[row] - STEP_SECONDS, 0.01)
    returns = seconds < STEP_SECONDS / 2
    memory.yields[row] = 0 if returns and np.linalg.norm(home - here) < HOME else seconds
    return home if returns else home + ASIDE * memory.retreat[row]


def is_stuck(people: People) -> Flags:
    """Whether a walker asks others to make way: they close its way, or leave too little room."""
    return people.walks & (np.maximum(people.aims.barred, people.memory.waited) > PATIENCE)


@compiled
def find_asks(
    them: Neighbours,
    mine: Index,
    hips: Float,
    homes: Float,
    stays: Flags,
    aside: Flags,
    found: Asks,
) -> None:
    """Finds for whom people at rows `mine` [A], at `hips` [A, 2], with places at `homes` [A, 2],
    step aside.

    A person asks while it is stuck. A person that has stepped `aside` [A] stays there for everybody
    that comes. If it does not stay (`stays` [A]), it only steps out of another one.
    """
    for row in range(len(mine)):
        me = mine[row]
        touches = found.touches[row] = _toucher(them, me)
        if aside[row]:
            found.comes[row] = _comer(them, me, homes, row, True, found)
        if stays[row] and touches < 0:
            found.asks[row] = _comer(them, me, hips, row, False, found)
        if touches >= 0:
            x = them.position[me, 0] - them.position[touches, 0]
            y = them.position[me, 1] - them.position[touches, 1]
            far = np.float32(sqrt(x * x + y * y))
            least = max(far, np.float32(1e-6))
            found.way[row, 0], found.way[row, 1], found.left[row] = y / least, -x / least, far


@inner
def _toucher(them: Neighbours, me: int) -> int:
    """The nearest at rest that is still where person `me` stands, and goes first; or -1."""
    nearest, first = np.float32(TOUCH), -1
    x, y = them.position[me, 0], them.position[me, 1]
    for side in range(-1, 2):
        begin, end = beside(them.cells, them.first[me], x, y, side)
        for k in range(begin, end):
            other = them.cells.rows[k]
            far = apart(them.position, me, them.position, other)
            if far > nearest or (far == nearest and other > first) or not is_level(them, me, other):
                continue  # of equally near ones the lower row is found
            rests = them.velocity[other, 0] == 0 and them.velocity[other, 1] == 0
            waits = them.walks[other] and them.stand[me]
            if rests and (waits or them.number[other] < them.number[me]):
                nearest, first = far, other
    return first


@inner
def _comer(them: Neighbours, me: int, places: Float, row: int, anybody: bool, found: Asks) -> int:
    """The nearest, that is stuck or `anybody`, whose way person `me` would close at `places[row]`;
    or -1. Writes the way.
    """
    nearest, first = np.float32(SIGHT), -1
    for side in range(-1, 2):
        begin, end = beside(them.cells, them.first[me], places[row, 0], places[row, 1], side)
        for k in range(begin, end):
            other = them.cells.rows[k]
            comes = them.walks[other] and (anybody or (them.asks[other] and them.stand[me]))
            if not comes or not is_level(them, me, other):
                continue
            x, y = them.preferred[other, 0], them.preferred[other, 1]
            long = max(np.float32(sqrt(x * x + y * y)), np.float32(1e-6))
            x, y = x / long, y / long
            to_x = places[row, 0] - them.position[other, 0]
            to_y = places[row, 1] - them.position[other, 1]
            on, left = to_x * x + to_y * y, x * to_y - y * to_x
            if on <= 0 or abs(left) >= np.float32(CLOSES):
                continue
            if on > nearest or (on == nearest and other > first):
                continue
            goes_x = them.spot[other, 0] - them.position[other, 0]
            goes_y = them.spot[other, 1] - them.position[other, 1]
            if on < np.float32(sqrt(goes_x * goes_x + goes_y * goes_y)):
                nearest, first = on, other
                found.way[row, 0], found.way[row, 1], found.left[row] = x, y, left
    return first


@inner
def is_level(them: Neighbours, me: int, other: int) -> bool:
    """Whether another one is on the floor of person `me`."""
    return other != me and abs(them.height[other] - them.height[me]) < np.float32(1.0)


@compiled
def find_stops(them: Neighbours, me: int, here: Float, home: Float) -> Float:
    """Where others on the floor of person `me`, that is at `here` [2] with a place at `home` [2],
    would come to a stand [N, 2]: those near `here` or `home`.
    """
    stops = np.empty((them.last[me] - them.first[me], 2), np.float32)
    count = 0
    for other in range(them.first[me], them.last[me]):
        if not is_level(them, me, other):
            continue
        x = them.position[other, 0] + np.float32(COASTS) * them.velocity[other, 0]
        y = them.position[other, 1] + np.float32(COASTS) * them.velocity[other, 1]
        near = (x - here[0]) ** 2 + (y - here[1]) ** 2
        near = min(near, (x - home[0]) ** 2 + (y - home[1]) ** 2)
        if near < NEIGHBOURS**2:
            stops[count, 0], stops[count, 1] = x, y
            count += 1
    return stops[:count].copy()


def are_stopped(here: Float, places: Array, others: Float) -> Flags:
    """Whether others [N, 2] stand in the way of a person that steps from `here` [2] to each place
    [P, 2].
    """
    gaps, steps = others - here, places - here
    far, span = np.linalg.norm(gaps, axis=-1), np.linalg.norm(steps, axis=-1, keepdims=True)
    along = (gaps * steps[:, None]).sum(-1) / np.maximum(span, 1e-6)  # [P, N]
    passes = far**2 - along**2 + (along - np.clip(along, 0, span)) ** 2
    stopped: Flags = (passes < np.minimum(BODY, NEARER * far) ** 2).any(1)
    return stopped


@cache
def prepare() -> None:
    """Compiles the rules, or loads them, before agents walk."""
    row, flag, place = np.zeros(1, np.int64), np.zeros(1, np.bool_), np.zeros((1, 2), np.float32)
    flags, one = (flag, flag, flag), place[0, :1]
    them = Neighbours(
        row, row + 1, cells_of(row, place), row, place, one, place, *flags, place, place
    )
    warm(find_asks, them, row, place, place, flag, flag, Asks.empty(1))
    warm(find_stops, them, row[0], place[0], place[0])
