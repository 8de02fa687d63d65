"""Where to walk among others: sampled reciprocal velocity obstacles.

Each person tries velocities around the one it would like, and takes that of the least cost (see
costs.py). As RVO has it, of somebody who avoids others, too, it expects half of what is to be done;
of others nothing. Bodies are slow to react and do not walk well below some speed: a person walks
faster than that or waits. Before people who come the other way it keeps to the right (lanes.py).
Two who block each other are parted by their numbers: the one of the higher number makes way, but
not for somebody who goes the same way, from behind.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.world.avoidance.costs import costs
from wayfarer.world.avoidance.lanes import keep_right
from wayfarer.world.avoidance.neighbours import Neighbours, near_pairs, neighbours
from wayfarer.world.avoidance.people import Float, Memory, People
from wayfarer.world.avoidance.rules import FAN, RULES, Rules
from wayfarer.world.rows import Index

EVEN: Final = 1e-4
"""Costs that differ by no more are equal: the first candidate is taken (1 m/s off the way costs 2).
Left and right often cost the same, and rounding must not choose. The web client's local mode has
the same rule.
"""

FACING: Final = 0.3
"""Cosine: somebody would walk towards one."""


@dataclass(frozen=True, slots=True)
class NextVelocity:
    """What [A] people shall do next."""

    velocity: Float  # [A, 2] m/s; zero for those who wait
    waits: NDArray[np.bool_]  # [A] stop, and go on when the way is free
    memory: Memory  # [A] of them for the next time


def avoid(
    people: People,
    rows: Index,
    preferred: Float,
    clear: Callable[[Float], Float] | None,
    seconds: float,
    left: Float | None = None,
    rules: Rules = RULES,
) -> NextVelocity:
    """The velocities that some people shall take.

    rows [A] of `people` who would walk at `preferred` [A, 2] m/s, not zero. `clear`: metres to the
    nearest wall at points [A, N, 2] of these rows, [A, N]; None: there are no walls. `seconds`:
    since they were asked last. `left` [A]: metres to where each will stop; None: nobody stops. A
    row's result depends on `people`, not on who else is asked.
    """
    memory = people.memory.take(rows)
    preferred = keep_together(people, rows, preferred)
    pairs = near_pairs(people, rows, rules)
    near = neighbours(people, rows, pairs, rules)
    yields = memory.yields > 0
    lane = keep_right(people, pairs, preferred, rules)
    way = np.where(yields[:, None], memory.retreat * rules.yield_speed, lane)
    tried = _candidates(way, memory.chosen, rules)
    total = costs(people, rows, near, way, tried, memory.chosen, clear, left, rules)
    best = (total <= total.min(1, keepdims=True) + EVEN).argmax(1)
    chosen = tried[np.arange(len(rows)), best]
    waits = ~chosen.any(-1)
    memory = _remember(memory, preferred, people.velocity[rows], chosen, seconds)
    return NextVelocity(chosen, waits, _make_way(memory, people, rows, near, rules))


def _candidates(way: Float, last: Float, rules: Rules) -> Float:
    """Velocities to try [A, C, 2]: the preferred one, a fan around it, the last, a stop."""
    speed = np.sqrt((way * way).sum(-1))
    # slower than a body can walk well only for those who want to
    least = np.minimum(rules.slowest, speed) / np.maximum(speed, 1e-6)
    length = np.sqrt((FAN * FAN).sum(-1))
    scale = np.maximum(length, least[:, None]) / length
    x = scale * (FAN[:, 0] * way[:, 0, None] - FAN[:, 1] * way[:, 1, None])
    y = scale * (FAN[:, 0] * way[:, 1, None] + FAN[:, 1] * way[:, 0, None])
    tried = np.zeros((len(way), len(FAN) + 2, 2), np.float32)
    tried[:, :-2, 0], tried[:, :-2, 1], tried[:, -2] = x, y, last
    return tried


def _remember(
    memory: Memory, preferred: Float, velocity: Float, chosen: Float, seconds: float
) -> Memory:
    """Update the waiting times: an agent that moves in its own direction does not wait."""
    speed = np.sqrt((preferred * preferred).sum(-1))
    on = (velocity * preferred).sum(-1) / np.maximum(speed, 1e-6)
    waited = np.where(on < 0.25 * speed, memory.waited + seconds, 0.0).astype(np.float32)
    yields = np.maximum(memory.yields - np.float32(seconds), 0)
    return replace(memory, preferred=preferred, chosen=chosen, waited=waited, yields=yields)


def _make_way(
    memory: Memory, people: People, rows: Index, near: Neighbours, rules: Rules
) -> Memory:
    """Those who have waited too long before others of lower numbers begin to make way for them."""
    impatient = (memory.waited > rules.patience) & (memory.yields <= 0)
    if not impatient.any():
        return memory
    theirs = people.memory.preferred[near.index]
    distance = np.maximum(near.distance, 1e-6)
    speed = np.maximum(np.sqrt((theirs * theirs).sum(-1)), 1e-6)
    towards = -(theirs[..., 0] * near.dx + theirs[..., 1] * near.dy) / (distance * speed)
    mine = memory.preferred / np.maximum(
        np.sqrt((memory.preferred * memory.preferred).sum(-1, keepdims=True)), 1e-6
    )
    along = (theirs[..., 0] * mine[:, :1] + theirs[..., 1] * mine[:, 1:]) / speed
    slow = (people.velocity[near.index] ** 2).sum(-1) < 0.25 * speed**2
    before = (
        ~near.nobody
        & people.walks[near.index]
        & (people.number[near.index] < people.number[rows][:, None])
        & (distance < 1.6)
        & (towards > FACING)
        & (along < rules.opposite)
        & slow
    )
    begins = impatient & before.any(1)
    first = before.argmax(1)
    pick = np.arange(len(rows)), first
    ahead = theirs[pick] / speed[pick][:, None]
    across = np.stack([near.dx[pick], near.dy[pick]], -1) * -1
    across = across - ahead * (across * ahead).sum(-1, keepdims=True)
    away = ahead + across / np.maximum(np.sqrt((across * across).sum(-1, keepdims=True)), 1e-6)
    away /= np.maximum(np.sqrt((away * away).sum(-1, keepdims=True)), 1e-6)
    return replace(
        memory,
        waited=np.where(begins, 0, memory.waited).astype(np.float32),
        yields=np.where(begins, rules.yielding, memory.yields).astype(np.float32),
        retreat=np.where(begins[:, None], away, memory.retreat).astype(np.float32),
    )


NEAR: Final = 6.0
"""Metres: farther away a companion is not waited for."""
LEAD: Final = 1.0
"""Metres ahead of the middle of its group from which a person slows down."""
SLOWEST: Final = 0.6
"""Share of its speed to which it slows down."""


def keep_together(people: People, rows: Index, preferred: Float) -> Float:
    """Preferred velocities [A, 2] of people at `rows`, slower for who is before its group."""
    grouped = np.flatnonzero(people.group[rows] > 0)
    if not len(grouped):
        return preferred
    mine = rows[grouped]
    way = preferred[grouped]
    unit = way / np.maximum(np.sqrt((way * way).sum(-1, keepdims=True)), 1e-6)
    apart = people.position[mine][:, None] - people.position  # [G, N, 2]
    with_me = (people.group[mine][:, None] == people.group) & ((apart * apart).sum(-1) < NEAR**2)
    middle = (apart * with_me[..., None]).sum(1) / with_me.sum(1, keepdims=True)
    ahead = (middle * unit).sum(-1)  # metres before the middle of those near
    adapted = preferred.copy()
    adapted[grouped] = way * np.clip(1 - 0.5 * (ahead - LEAD), SLOWEST, 1.0)[:, None]
    return adapted.astype(np.float32)
