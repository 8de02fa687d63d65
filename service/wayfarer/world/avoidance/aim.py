"""Where a person would go among others, and the ways about it. Metres, seconds, m/s.

Its group and oncoming people change where it would go.
"""

from math import sqrt
from typing import Final

import numpy as np

from wayfarer.process.compiled import compiled, inner
from wayfarer.world.avoidance.kernel import (
    FAN,
    NEIGHBOURS,
    OPPOSITE,
    PUSH,
    TINY,
    TRIED,
    Choices,
    Everybody,
    are_against,
    length,
)
from wayfarer.world.rows import Double, Float, Index

SIGHT: Final = 8.0  # metres beyond which others are ignored
STOREY: Final = 2.0  # metres up or down from which others are on another storey
LANE: Final = 0.6  # metres by which oncoming people are passed on the right
LANE_SIGHT: Final = 12.0  # metres ahead in which they are seen
LANE_WIDE: Final = 1.8  # metres to either side of the way in which they are
BESIDE: Final = 1.2  # metres to the right from which one person is passed on the left
LANE_SOON: Final = 0.5  # seconds: a lane is taken no faster, however near somebody is,
LANE_MOST: Final = 0.8  # nor at a greater share of the speed

NEAR: Final = 6.0  # metres: farther away a companion is not waited for
LEAD: Final = 1.0  # metres ahead of the middle of its group from which a person slows down
GROUP_SLOWEST: Final = 0.6  # share of its speed to which it slows down
PASS_SHARE: Final = 0.8  # share of half the width that is then between two who pass
YIELD_SPEED: Final = 0.6  # m/s of a person that makes way


@inner
def _keep_together(everybody: Everybody, me: int, x: float, y: float) -> float:
    """Share of its speed that a person keeps that is before its group."""
    if everybody.group[me] <= 0:
        return 1.0
    speed = max(length(x, y), TINY)
    ahead, count = 0.0, 0
    for other in range(everybody.first[me], everybody.last[me]):
        if everybody.group[other] != everybody.group[me]:
            continue
        dx = float(everybody.position[me, 0] - everybody.position[other, 0])
        dy = float(everybody.position[me, 1] - everybody.position[other, 1])
        if dx * dx + dy * dy < NEAR * NEAR:
            ahead += (dx * x + dy * y) / speed
            count += 1
    return min(max(1 - 0.5 * (ahead / count - LEAD), GROUP_SLOWEST), 1.0)


@inner
def _neighbours(everybody: Everybody, me: int, near: Index, urgencies: Double) -> int:
    """Writes the people that are near now, or will be in a second, the nearest first. How many."""
    count = 0
    for other in range(everybody.first[me], everybody.last[me]):
        dx = float(everybody.position[other, 0] - everybody.position[me, 0])
        dy = float(everybody.position[other, 1] - everybody.position[me, 1])
        square = dx * dx + dy * dy
        seen = (square <= SIGHT * SIGHT) & (other != me)
        if not (seen & (abs(everybody.height[other] - everybody.height[me]) < STOREY)):
            continue
        distance = sqrt(square)
        if count == NEIGHBOURS and distance >= urgencies[count - 1]:
            continue
        soon = length(
            dx + everybody.velocity[other, 0] - everybody.velocity[me, 0],
            dy + everybody.velocity[other, 1] - everybody.velocity[me, 1],
        )
        urgency = distance + soon
        if count == NEIGHBOURS and urgency >= urgencies[count - 1]:
            continue
        at = min(count, NEIGHBOURS - 1)
        while at > 0 and urgencies[at - 1] > urgency:  # of two alike the lower row is the first
            urgencies[at], near[at] = urgencies[at - 1], near[at - 1]
            at -= 1
        urgencies[at], near[at] = urgency, other
        count = min(count + 1, NEIGHBOURS)
    return count


@inner
def _keep_right(
    everybody: Everybody, me: int, px: float, py: float, lane: float
) -> tuple[float, float]:
    """The preferred velocity, turned to the right of oncoming people.

    Everybody in sight counts, not the nearest few: in a stream these go the same way. A person that
    waits is oncoming, too, if it wants to come. A single one matters where it is nearly ahead; a
    stream shall be passed to the right of its middle.
    """
    speed = max(length(px, py), TINY)
    ux, uy = px / speed, py / speed
    pair, total, count = 0.0, 0.0, 0
    for other in range(everybody.first[me], everybody.last[me]):
        dx = float(everybody.position[other, 0] - everybody.position[me, 0])
        dy = float(everybody.position[other, 1] - everybody.position[me, 1])
        ahead, left = dx * ux + dy * uy, dy * ux - dx * uy
        seen = (ahead > 0) & (ahead < LANE_SIGHT) & (abs(left) < LANE_WIDE) & everybody.walks[other]
        if not (seen & (abs(everybody.height[other] - everybody.height[me]) < STOREY)):
            continue
        x, y = float(everybody.preferred[other, 0]), float(everybody.preferred[other, 1])
        fast = max(length(x, y), TINY)
        if -(x * ux + y * uy) / fast <= OPPOSITE or not are_against(everybody, me, other):
            continue
        aside = max(lane - left, 0.0) / max(ahead / (speed + fast), LANE_SOON)
        pair = max(pair, aside * min(max(left + BESIDE, 0.0), 1.0))
        total += aside
        count += 1
    if count == 0:
        return px, py
    stream = total / count * (1 - 1 / count)
    sideways = min(max(pair, stream), LANE_MOST * speed)
    sideways /= 1 + float(everybody.waited[me]) / PUSH
    if sideways <= 0:
        return px, py
    x, y = px + sideways * uy, py - sideways * ux
    turned = speed / max(length(x, y), TINY)
    return float(np.float32(turned * x)), float(np.float32(turned * y))


@compiled
def aim(everybody: Everybody, rows: Index, preferred: Float, half: Float, made: Choices) -> None:
    """Where people `rows` [A] may go that would walk at `preferred` [A, 2], into `made`.

    half [A]: half the width of their ways.
    """
    urgencies = np.empty(NEIGHBOURS)
    for row in range(len(rows)):
        me = rows[row]
        slowed = _keep_together(everybody, me, float(preferred[row, 0]), float(preferred[row, 1]))
        made.preferred[row, 0] = slowed * preferred[row, 0]
        made.preferred[row, 1] = slowed * preferred[row, 1]
        px, py = float(made.preferred[row, 0]), float(made.preferred[row, 1])
        made.known[row] = _neighbours(everybody, me, made.near[row], urgencies)
        if everybody.yields[me] > 0:
            px, py = YIELD_SPEED * everybody.retreat[me, 0], YIELD_SPEED * everybody.retreat[me, 1]
        else:
            px, py = _keep_right(everybody, me, px, py, min(LANE, PASS_SHARE * float(half[row])))
        made.aim[row, 0], made.aim[row, 1] = px, py
        speed = max(length(px, py), TINY)
        ux, uy = px / speed, py / speed
        for k in range(len(FAN)):
            made.ways[row, k, 0] = FAN[k, 0] * ux - FAN[k, 1] * uy
            made.ways[row, k, 1] = FAN[k, 0] * uy + FAN[k, 1] * ux
        last_x, last_y = float(everybody.chosen[me, 0]), float(everybody.chosen[me, 1])
        before = max(length(last_x, last_y), TINY)
        made.ways[row, TRIED - 2, 0] = last_x / before
        made.ways[row, TRIED - 2, 1] = last_y / before
        made.ways[row, TRIED - 1, 0] = made.ways[row, TRIED - 1, 1] = 0.0
