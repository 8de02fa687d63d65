"""Making way: a standing agent steps aside when another is stuck before it or waits in its place,
and returns when its place is free. If two agents stand or wait in each other, the
one with the higher number steps aside, and a standing one always does so for a waiting one.

`Memory.yields` counts the seconds until it returns, `Aims.spot` is the place that it left,
`Memory.retreat` the way from there to where it steps, in `ASIDE`. World's frame, metres.
"""

from typing import Final

import numpy as np

from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Feeding, Mode, Motion, Slots
from wayfarer.world.avoidance.people import Memory, People
from wayfarer.world.rows import Array, Flags, Float, Index
from wayfarer.world.scenes.collision_avoidance import CollisionAvoidance
from wayfarer.world.scenes.company import PATIENCE
from wayfarer.world.scenes.passages import COASTS
from wayfarer.world.scenes.people import SessionPeople
from wayfarer.world.scenes.spots import FARTHEST
from wayfarer.world.scenes.world_scenes import WorldScenes

SIGHT: Final = 2.5
"""Metres ahead of an agent within which people make way for it."""

CLOSES: Final = 0.5
"""Metres to either side of its way within which a person closes it."""

ASIDE: Final = 0.8
"""Metres of a step aside."""

SIDES: Final = np.radians([75, 45, 105, 135, -75, -45, -105, -135])
STEPS: Final = np.concatenate([s * np.stack([np.cos(SIDES), np.sin(SIDES)], 1) for s in (1, 0.6)])
"""Such steps [S, 2], and shorter ones: along a way, and to the side on which the person stands."""

APART: Final = 0.46
"""Metres that a step leaves between two people."""

BODY, BESIDE = 0.37, 0.1
"""Metres beside the line of a step within which somebody stops it, and ahead from which."""

TOUCH: Final = 0.4
"""Metres between two standing people within which their bodies may be in each other."""

RETURNS: Final = 1.0
"""Seconds for which people remain aside once their places are in nobody's way."""

HOME: Final = 0.25
"""Metres from its place within which a person is back."""


Asks = tuple[Array, float]
"""The way of another one [2], and metres from it to a person, to the left."""


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
        memory.yields[stays & (gait.mode == Mode.WALKING)] = 0.0  # it made way as it walked
        which = np.flatnonzero((stays | ~ahead.given) & self._may_step(rows, hips, start, ahead))
        for mine, them in self._avoidance.sessions(rows, which):
            stops = them.people.position + COASTS * them.people.velocity
            for row, me in zip(mine.tolist(), them.rows(rows[mine]).tolist(), strict=True):
                here, level = hips[row], them.level(me)
                aside = bool(stays[row] and memory.yields[row] > 0)
                home, others = spots[row] if aside else here, stops[level]
                touches = toucher(them, me)
                comes = comer(them, me, home, aside) if aside or not touches else None
                asks = touches or (comes if stays[row] and not aside else None)
                step = self._step(int(rows[row]), here, *asks, others) if asks else None
                if step is not None:
                    place, retreat = here + ASIDE * step, step + (here - home) / ASIDE
                elif not aside:
                    continue
                if stays[row]:
                    if step is not None:
                        spots[row], memory.retreat[row] = home, retreat
                    taken = bool((np.linalg.norm(others - spots[row], axis=-1) < TOUCH).any())
                    place = next_place(memory, row, here, spots[row], taken or comes is not None)
                if not stays[row] or memory.yields[row] > 0:
                    ahead.given[row] = not is_stopped(here, place, stops[me], others)
                    ahead.through[row], ahead.strafe[row], ahead.tread[row] = False, True, 0.0
                    ahead.radius[row], ahead.speed[row] = 0.1, 0.8
                    ahead.position[row, :2], ahead.heading[row] = place, gait.stop_facing[row]

    def _may_step(self, rows: Index, hips: Float, start: Motion, ahead: GoalColumns) -> Flags:
        """Which of rows [A] at `hips` [A, 2] may step: they are aside, near an agent that asks, or
        so near an agent at rest that their bodies overlap.

        An agent that faces a heading, or is far from its goal, may not.
        """
        slots, crowd = self._slots, self._avoidance.crowd
        asks = is_stuck(crowd.people)
        at_goal = np.linalg.norm(hips - start.aims.asked, axis=-1) < FARTHEST
        free = ~ahead.given | (at_goal & ~ahead.heading.any(-1))
        free &= slots.avoids[rows] & (slots.feeding[rows] != Feeding.EACH_STEP)
        may, still = start.memory.yields > 0, np.all(crowd.people.velocity == 0, -1)
        may[free] |= crowd.near(rows[free], asks, SIGHT + CLOSES)
        may[free] |= crowd.near(rows[free], still, TOUCH)
        return free & may

    def _step(self, slot: int, here: Float, way: Array, left: float, others: Array) -> Array | None:
        """A slot's step, in `ASIDE`, from `here` [2], `left` of a way [2], to a free place.

        `others` [N, 2]: where everybody else would come to a stand.
        """
        clear, room = self._scenery.walls(slot)
        tried = STEPS * [1, 1 if left >= 0 else -1]
        steps = tried @ np.array([way, [-way[1], way[0]]])
        places = here + ASIDE * steps
        free = (clear(places) >= room) & (np.abs(left + ASIDE * tried[:, 1]) >= CLOSES)
        free &= (np.linalg.norm(places[:, None] - others, axis=-1) >= APART).all(1)
        return steps[free.argmax()] if free.any() else None


def next_place(memory: Memory, row: int, here: Float, home: Float, needed: bool) -> Float:
    """Where a person steps to [2]; counts the seconds since its `home` was last `needed`."""
    seconds = RETURNS if needed else max(memory.yields[row] - STEP_SECONDS, 0.01)
    returns = seconds < STEP_SECONDS / 2
    memory.yields[row] = 0 if returns and np.linalg.norm(home - here) < HOME else seconds
    return home if returns else home + ASIDE * memory.retreat[row]


def comer(them: SessionPeople, me: int, home: Float, aside: bool) -> Asks | None:
    """The nearest whose way person `me` closes at its place `home` [2]: the direction of that way
    [2], and metres from it to `home`, to the left. It asks, unless `me` has stepped `aside`.
    """
    people = them.people
    to, way = home - people.position, people.memory.preferred
    way = way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-6)
    on, left = (to * way).sum(-1), way[:, 0] * to[:, 1] - way[:, 1] * to[:, 0]
    goes = np.linalg.norm(people.aims.spot - people.position, axis=-1)
    comes = people.walks & (aside | (is_stuck(people) & them.stand[me]))
    comes &= (on > 0) & (on < np.minimum(SIGHT, goes)) & (np.abs(left) < CLOSES) & them.level(me)
    first = int(np.where(comes, on, np.inf).argmin())
    return (way[first], left[first]) if comes[first] else None


def is_stuck(people: People) -> Flags:
    """Whether a walker asks others to make way: they close its way, or leave too little room."""
    return people.walks & (np.maximum(people.aims.barred, people.memory.waited) > PATIENCE)


def toucher(them: SessionPeople, me: int) -> Asks | None:
    """Like `comer`, of the nearest that is still where `me` stands: a way through it, past `me`."""
    people = them.people
    to = people.position[me] - people.position
    far = np.linalg.norm(to, axis=-1)
    touches = (far < TOUCH) & ~people.velocity.any(-1) & them.level(me)
    touches &= (people.walks & them.stand[me]) | (people.number < people.number[me])
    first = int(np.where(touches, far, np.inf).argmin())
    way = np.array([to[first, 1], -to[first, 0]]) / max(float(far[first]), 1e-6)
    return (way, float(far[first])) if touches[first] else None


def is_stopped(here: Float, place: Float, stop: Float, others: Float) -> bool:
    """Whether others [N, 2] stand before a person that steps from `here` [2] to a place [2].

    It would come to a stand at `stop` [2].
    """
    gaps, step = others - stop, place - here
    far, along = np.linalg.norm(gaps, axis=-1), gaps @ step / max(np.linalg.norm(step), 1e-6)
    return bool(((along > BESIDE) & (far**2 - along**2 < BODY**2) & (far < APART)).any())
