"""Making way: a standing agent steps aside when another is stuck before it or waits in its place,
and returns when its place is free. If it is in the way where it stepped, it steps again, but never
too far from its goal. If there is no room beside the way, it steps on along it. If two agents stand
or wait in each other, the one with the higher number steps aside, and a standing one always does so
for a waiting one. A step leads through nobody.

`Memory.yields` counts the seconds until it returns, `Aims.spot` is the place that it left,
`Memory.retreat` the way from there to where it steps, in `ASIDE`. World's frame, metres.
"""

from functools import cache
from math import inf, sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Feeding, Motion, Slots
from wayfarer.world.goals.gait_rules import GoalArrays
from wayfarer.world.output.turns import apart
from wayfarer.world.rows import Double, Flags, Float, Index, Int8, columns
from wayfarer.world.scenes.asks import CLOSES, Asks, Neighbours, find_asks, is_level, nobody
from wayfarer.world.scenes.collision_avoidance import CollisionAvoidance
from wayfarer.world.scenes.company import TOUCH
from wayfarer.world.scenes.passages import coasted
from wayfarer.world.scenes.spots import FARTHEST
from wayfarer.world.scenes.world_scenes import WorldScenes

ASIDE: Final = 0.8
"""Metres of a step aside."""

SIDES: Final = np.radians([75, 45, 105, 135, -75, -45, -105, -135])
STEPS: Final = np.concatenate(
    [s * np.stack([np.cos(SIDES), np.sin(SIDES)], 1) for s in (1, 0.6)]
    + [np.array([(1, 0), (0.6, 0), (-1, 0), (-0.6, 0)])]
)
"""Such steps [S, 2], and shorter ones: along a way, and to the side on which the person stands. The
ones along the way leave it closed, but lead out of another one, beside a wall, too."""

APART: Final = 0.46
"""Metres that a step leaves between two people."""

BODY, NEARER = 0.37, 0.9
"""Metres beside the line of a step within which another one stops it, or this share of the distance
to that one if that is less: a step may lead out of another one, not through it."""

ROOMIER: Final = 0.05
"""Metres of more room that make a step out of another one worthwhile where no place is free."""

RETURNS: Final = 1.0
"""Seconds for which people remain aside once their places are in nobody's way."""

HOME: Final = 0.25
"""Metres from its place within which a person is back."""

NEIGHBOURS: Final = 1.5
"""Metres from a person and its place within which others matter to its step."""

EACH_STEP = int(Feeding.EACH_STEP)


class Stepping(NamedTuple):
    """Some people [A] that may step, and their places."""

    row: Index  # of the batch
    me: Index  # row of everybody
    hips: Float
    homes: Float
    aside: Flags  # it has stepped aside

    @classmethod
    def empty(cls, count: int) -> "Stepping":
        """Zeroed columns of some people."""
        (row, me), (hips, homes) = np.zeros((2, count), int), np.zeros((2, count, 2), np.float32)
        return cls(row, me, hips, homes, np.zeros(count, np.bool_))


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
        crowd, count, steers = self._avoidance.crowd, len(rows), columns(GoalArrays, ahead)
        places, memory = (start.aims.asked, start.aims.spot), start.memory
        own = Stepping.empty(count)
        when = self._slots.avoids, self._slots.feeding, crowd.places
        count = find_free(when, rows, hips, stays, steers, memory.yields, places, own)
        if not count:
            return
        own = Stepping._make(each[:count] for each in own)
        everybody, asks = Neighbours.of(crowd), Asks.empty(count)
        find_asks(everybody, own.me, own.hips, own.homes, stays[own.row], own.aside, asks)
        if not find_steps(own, asks, steps := np.empty((count, len(STEPS), 2))):
            return
        some = rows[own.row]
        room = self._scenery.distance(some, steps) - self._scenery.radius(some)[:, None]
        remembered = memory.yields, memory.retreat
        take_steps(
            everybody,
            own,
            asks,
            steps,
            room,
            stays,
            places,
            remembered,
            steers,
            start.gait.stop_facing,
        )


@compiled
def find_free(
    slots: tuple[Flags, Int8, Index],
    rows: Index,
    hips: Float,
    stays: Flags,
    ahead: GoalArrays,
    yields: Float,
    places: tuple[Float, Float],
    own: Stepping,
) -> int:
    """Finds which of `rows` [A] may step, and returns their number. A row with a goal may only step
    if it `stays`, faces no heading, and is near the goal or has stepped aside from there.

    `slots`: whether each avoids others, its `Feeding`, and its row of everybody. `places`: goals
    and spots of the rows.
    """
    count, (avoids, feeding, people), (asked, spot) = 0, slots, places
    for row in range(len(rows)):
        may = avoids[rows[row]] and feeding[rows[row]] != EACH_STEP
        if ahead.given[row]:
            near = yields[row] > 0 or apart(hips, row, asked, row) < np.float32(FARTHEST)
            may = may and stays[row] and near
            may = may and ahead.heading[row, 0] == 0 and ahead.heading[row, 1] == 0
        if may:
            own.row[count], own.me[count] = row, people[rows[row]]
            own.aside[count] = aside = stays[row] and yields[row] > 0
            is_home = aside or apart(spot, row, hips, row) < np.float32(HOME)
            for axis in range(2):
                own.hips[count, axis] = hips[row, axis]
                own.homes[count, axis] = spot[row, axis] if is_home else hips[row, axis]
            count += 1
    return count


@compiled
def find_stops(them: Neighbours, me: int, here: Float, home: Float) -> Float:
    """Where others on the floor of person `me`, that is at `here` [2] with a place at `home` [2],
    would come to a stand [N, 2]: those near `here` or `home`.
    """
    stops = np.empty((them.people.last[me] - them.people.first[me], 2), np.float32)
    count = 0
    for other in range(them.people.first[me], them.people.last[me]):
        if not is_level(them, me, other):
            continue
        x, y = coasted(them.people.position, them.people.velocity, other)
        near = (x - here[0]) ** 2 + (y - here[1]) ** 2
        near = min(near, (x - home[0]) ** 2 + (y - home[1]) ** 2)
        if near < NEIGHBOURS**2:
            stops[count, 0], stops[count, 1] = x, y
            count += 1
    return stops[:count].copy()


@compiled
def is_stopped(here: Float, x: float, y: float, others: Float) -> bool:
    """Whether others [N, 2] stand in the way of a person that steps from `here` [2] to (x, y)."""
    on_x, on_y, none = x - here[0], y - here[1], np.float32(0)
    span = sqrt(on_x * on_x + on_y * on_y)
    for k in range(len(others)):
        gap_x, gap_y = others[k, 0] - here[0], others[k, 1] - here[1]
        far = np.float32(sqrt(gap_x * gap_x + gap_y * gap_y))
        along = (gap_x * on_x + gap_y * on_y) / max(span, np.float32(1e-6))
        beyond = along - min(max(along, none), span)
        room = min(np.float32(BODY), np.float32(NEARER) * far)
        if far * far - along * along + beyond * beyond < room * room:
            return True
    return False


@compiled
def find_steps(own: Stepping, asks: Asks, places: Double) -> bool:
    """Writes where people [A] may step, [A, S, 2]. Returns whether any is asked to, or has."""
    found = False
    for at in range(len(own.me)):
        found = found or own.aside[at] or asks.touches[at] >= 0 or asks.asks[at] >= 0
        for k in range(len(STEPS)):
            x, y = _step(asks, at, k)
            places[at, k, 0] = own.hips[at, 0] + ASIDE * x
            places[at, k, 1] = own.hips[at, 1] + ASIDE * y
    return found


@inner
def _step(asks: Asks, at: int, k: int) -> tuple[float, float]:
    """Step `k` of person `at` in the world's frame, in `ASIDE`."""
    x, y, on = asks.way[at, 0], asks.way[at, 1], STEPS[k, 0]
    aside = STEPS[k, 1] if asks.left[at] >= 0 else -STEPS[k, 1]
    return on * x - aside * y, on * y + aside * x


@compiled
def best_step(
    here: Float, goal: Float, asks: Asks, at: int, places: Double, room: Double, others: Float
) -> int:
    """The first step of a person from `here` [2] to a free one of `places` [S, 2], or -1. The place
    is near its `goal` [2], and nobody stops it on the way there. Neighbours would come to a stand
    at `others` [N, 2]. `room` [S]: metres that the places leave to walls.

    A person that cannot leave the way steps on along it. A person that touches another need not
    leave it. If no place is free, it takes the one with the most room, if that is more than it has.
    """
    rooms, touches = np.zeros(len(STEPS)), asks.touches[at] >= 0
    for k in range(len(STEPS)):
        on, aside = STEPS[k, 0], STEPS[k, 1] if asks.left[at] >= 0 else -STEPS[k, 1]
        may = touches or (on > 0 and aside == 0) or abs(asks.left[at] + ASIDE * aside) >= CLOSES
        x, y = places[k, 0], places[k, 1]
        near = sqrt((x - goal[0]) * (x - goal[0]) + (y - goal[1]) * (y - goal[1])) < FARTHEST
        if may and near and room[k] >= 0 and not is_stopped(here, x, y, others):
            rooms[k] = _nearest(x, y, others)
    least = APART
    if touches:
        own = _nearest(float(here[0]), float(here[1]), others)
        least = min(APART, max(own + ROOMIER, rooms.max() - ROOMIER))
    for k in range(len(STEPS)):
        if rooms[k] >= least:
            return k
    return -1


@inner
def _nearest(x: float, y: float, others: Float) -> float:
    """Metres from a place to the nearest of others [N, 2]."""
    nearest = inf
    for k in range(len(others)):
        to_x, to_y = x - others[k, 0], y - others[k, 1]
        nearest = min(nearest, sqrt(to_x * to_x + to_y * to_y))
    return nearest


@compiled
def take_steps(
    them: Neighbours,
    own: Stepping,
    asks: Asks,
    places: Double,
    room: Double,
    stays: Flags,
    aims: tuple[Float, Float],
    memory: tuple[Float, Float],
    ahead: GoalArrays,
    facing: Float,
) -> None:
    """Makes people [A] step to one of `places` [A, S, 2], or back. `room` [A, S]: metres that those
    leave to walls. The other arguments are columns of the batch. `aims`: goals and spots. `memory`:
    `yields` and `retreat`. `facing`: the facing that each keeps.
    """
    (asked, spot), (yields, retreat) = aims, memory
    for at in range(len(own.me)):
        row, me, here, home = own.row[at], own.me[at], own.hips[at], own.homes[at]
        is_asked = asks.touches[at] >= 0 or asks.asks[at] >= 0
        if not (is_asked or own.aside[at]):
            continue
        others = find_stops(them, me, here, home)
        stop_x, stop_y = coasted(them.people.position, them.people.velocity, me)
        stopped, step = is_stopped(here, stop_x, stop_y, others), -1
        if is_asked and not stopped:
            goal = asked[row] if ahead.given[row] else here
            step = best_step(here, goal, asks, at, places[at], room[at], others)
        if step < 0 and not own.aside[at]:
            continue
        if stays[row]:
            if step >= 0:
                x, y = _step(asks, at, step)
                retreat[row, 0] = x + (here[0] - home[0]) / np.float32(ASIDE)
                retreat[row, 1] = y + (here[1] - home[1]) / np.float32(ASIDE)
                spot[row, 0], spot[row, 1] = home[0], home[1]
            taken = _nearest(float(spot[row, 0]), float(spot[row, 1]), others) < TOUCH
            # an agent in the way that can step no farther is better off at its place
            needed = taken or step >= 0 or asks.comes[at] >= 0
            x, y = _next_place(yields, retreat, row, here, spot[row], needed)
            if yields[row] <= 0:
                continue
            stopped = stopped or is_stopped(here, x, y, others)
            ahead.position[row, 0], ahead.position[row, 1] = x, y
        else:
            x, y = places[at, step, 0], places[at, step, 1]
            stopped = stopped or is_stopped(here, x, y, others)
            ahead.position[row, 0], ahead.position[row, 1] = x, y
        ahead.given[row], ahead.through[row], ahead.strafe[row] = not stopped, False, True
        ahead.tread[row], ahead.radius[row], ahead.speed[row] = 0.0, 0.1, 0.8
        ahead.heading[row, 0], ahead.heading[row, 1] = facing[row, 0], facing[row, 1]


@inner
def _next_place(
    yields: Float, retreat: Float, row: int, here: Float, home: Float, needed: bool
) -> tuple[float, float]:
    """Where a person steps to; counts the seconds since its `home` was last `needed`."""
    seconds = np.float32(RETURNS)
    if not needed:
        seconds = max(yields[row] - np.float32(STEP_SECONDS), np.float32(0.01))
    x, y = home[0] - here[0], home[1] - here[1]
    if seconds >= np.float32(STEP_SECONDS / 2):
        yields[row] = seconds
        aside = np.float32(ASIDE)
        return home[0] + aside * retreat[row, 0], home[1] + aside * retreat[row, 1]
    yields[row] = np.float32(0) if sqrt(x * x + y * y) < np.float32(HOME) else seconds
    return home[0], home[1]


@cache
def prepare() -> None:
    """Compiles the rules, or loads them, before agents walk."""
    row, flag, place = np.zeros(1, np.int64), np.zeros(1, np.bool_), np.zeros((1, 2), np.float32)
    mode = np.zeros(1, np.int8)
    slots, steers = (flag, mode, row), columns(GoalArrays, GoalColumns.empty(1))
    own, steps = Stepping(row, row, place, place, flag), np.zeros((1, len(STEPS), 2))
    warm(find_free, slots, row, place, flag, steers, place[0, :1], (place, place), own)
    warm(find_steps, own, Asks.empty(1), steps)
    aims, memory, room = (place, place), (place[0, :1], place), steps[..., 0].copy()
    asks = Asks.empty(1)
    warm(take_steps, nobody(), own, asks, steps, room, flag, aims, memory, steers, place)
