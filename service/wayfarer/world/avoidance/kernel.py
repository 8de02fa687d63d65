"""The rule of avoidance for one person at a time, compiled. Metres, seconds, m/s.

The web client's local mode has the same functions by the same names.
"""

from math import cos, radians, sin, sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner
from wayfarer.world.rows import Double, Flags, Float, Index, Int

TURNS: Final = (0, 12, -12, 25, -25, 40, -40, 60, -60, 85, -85, 120, -120, 160)
"""Degrees from the preferred direction that are tried, anticlockwise."""
SPEEDS: Final = (1.0, 0.6)
"""Shares of the preferred speed that are tried."""
FAN: Final = np.array(
    [(s * cos(radians(a)), s * sin(radians(a))) for s in SPEEDS for a in TURNS], np.float32
)
"""The candidates [F, 2], in a frame in which the preferred velocity is (1, 0)."""
TRIED: Final = len(FAN) + 2
"""Candidates: the fan, the last velocity, a stop."""
WIDE: Final = -(-TRIED // 8) * 8
"""That many numbers fill whole registers; the last ones mean nothing."""

NEIGHBOURS: Final = 10  # of whom a person takes notice at most
SIGHT: Final = 8.0  # metres beyond which others are ignored
STOREY: Final = 2.0  # metres up or down from which others are on another storey
HORIZON: Final = 3.5  # seconds that are looked ahead
SOON: Final = 0.3  # what happens before cannot be helped
CLOSE: Final = 1.5  # nearer nobody relies on others; twice as far, on half of the task
COMFORT: Final = 0.35  # preferred room between two, beside their radii
REACTION: Final = 0.25  # seconds until a body follows a new velocity
SLOWEST: Final = 0.5  # m/s: nobody walks well more slowly
WALL_ROOM: Final = 0.1  # preferred between a person's radius and a wall
WALL_SHARE: Final = 0.42  # but in a narrow way at most that share of half its width
LANES: Final = 0.9  # half of a way's width within which it has lanes (see scenes/lanes.py): …
PASSING: Final = 0.3  # … who comes the other way keeps to its own, and no more room is asked for
PASS_SHARE: Final = 0.8  # share of half the width that is then between two who pass
WALL_TIMES: Final = (0.3, 0.7, 1.2)  # at which a way is looked at for walls

DEVIATION: Final = 2.0  # costs, of 1 m/s: not to go where one would
CHANGE: Final = 0.7  # to go elsewhere than last time
COLLISION: Final = 2.2  # to collide (at once: ten times that)
WALL: Final = 15.0  # to touch a wall
EVEN: Final = 1e-4
"""Costs that differ by no more are equal: the first candidate is taken (1 m/s off the way costs 2).
Left and right often cost the same, and rounding must not choose."""

PATIENCE: Final = 1.25  # seconds of waiting until a person makes way for those before it
YIELDING: Final = 1.6  # seconds for which it does
YIELD_SPEED: Final = 0.6
PUSH: Final = 4.0  # seconds of waiting until a person is content with half of the room
MIN_COMFORT: Final = 0.15  # and the room that it wants however long it waits
BESIDE_STANDING: Final = 0.1  # preferred room beside a person that stands, before any wait
ALONG: Final = (
    0.3  # cosine of directions from which another one is a leader, which goes the same way
)
BEHIND: Final = 0.1  # preferred room behind and beside a leader
FOLLOWS: Final = 2.0  # seconds that are looked ahead at a leader
FIRM: Final = 0.25  # divides the cost of too little room behind a leader
TOUCH: Final = 6.0  # cost of 1 m/s towards a person that it touches
TOUCHES: Final = 0.15  # metres beyond their radii at which that cost is nothing
STANDS_APART: Final = 0.05  # room beside those where it stops
IN_GROUP: Final = 0.05  # room, and weight, between two of one group
HURRY: Final = 2.5  # seconds of waiting; after n times that it looks ahead 1/n as far
SHORTEST: Final = 1.0  # seconds that it looks ahead at least
BLOCKING: Final = 1.6  # metres within which somebody stands in one's way …
FACING: Final = 0.3  # … and cosine: it would walk towards one

OPPOSITE: Final = 0.5  # cosine from which two walk against each other, or the same way
LANE: Final = 0.6  # metres by which oncoming people are passed on the right
LANE_SIGHT: Final = 12.0  # metres ahead in which they are seen
LANE_WIDE: Final = 1.8  # metres to either side of the way in which they are
BESIDE: Final = 1.2  # metres to the right from which one person is passed on the left
LANE_SOON: Final = 0.5  # seconds: a lane is taken no faster, however near somebody is,
LANE_MOST: Final = 0.8  # nor at a greater share of the speed

NEAR: Final = 6.0  # metres: farther away a companion is not waited for
LEAD: Final = 1.0  # metres ahead of the middle of its group from which a person slows down
GROUP_SLOWEST: Final = 0.6  # share of its speed to which it slows down

TINY: Final = 1e-6


class Everybody(NamedTuple):
    """Everybody of some sessions [N]: the columns of `People` and of its `Memory` (see people.py).

    `first` and `last`: the rows of everybody's own session, which lie together.
    """

    first: Index
    last: Index
    number: Int
    group: Int
    position: Float
    height: Float
    velocity: Float
    walks: Flags
    radius: Float
    preferred: Float
    chosen: Float
    waited: Float
    yields: Float
    retreat: Float


class Choices(NamedTuple):
    """What some people [A] may do next."""

    preferred: Float  # [A, 2] as their groups have it
    tried: Float  # [A, C, 2] velocities
    costs: Double  # [A, C]
    near: Index  # [A, K] those who matter soonest: rows of everybody, the first `known` of each
    known: Index  # [A]


class Fan(NamedTuple):
    """The velocities [C] that one person tries, and what it thinks of them: room to work in."""

    x: Double
    y: Double
    last: Double  # seconds that are looked ahead at most
    most: Double  # cost of the worst meeting …
    total: Double  # … and of all


class Next(NamedTuple):
    """What they [A] do, and remember of it."""

    velocity: Float  # [A, 2]
    waited: Float
    yields: Float
    retreat: Float  # [A, 2]


@inner
def _length(x: float, y: float) -> float:
    return sqrt(x * x + y * y)


@inner
def _keep_together(everybody: Everybody, me: int, x: float, y: float) -> float:
    """Share of its speed that who is before its group keeps."""
    if everybody.group[me] <= 0:
        return 1.0
    speed = max(_length(x, y), TINY)
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
    """Those in sight who are near now, or will be in a second; the nearest first. How many."""
    count = 0
    for other in range(everybody.first[me], everybody.last[me]):
        dx = float(everybody.position[other, 0] - everybody.position[me, 0])
        dy = float(everybody.position[other, 1] - everybody.position[me, 1])
        square = dx * dx + dy * dy
        if square > SIGHT * SIGHT or other == me:
            continue
        if abs(everybody.height[other] - everybody.height[me]) >= STOREY:
            continue
        distance = sqrt(square)
        if count == NEIGHBOURS and distance >= urgencies[count - 1]:
            continue
        soon = _length(
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
    """The preferred velocity, turned to the right for who is oncoming.

    Everybody in sight counts, not the nearest few: in a stream those are one's own. What counts is
    where others want to go, so who waits is oncoming, too. Of one person that comes the other way
    only the one nearly ahead matters; of a stream its middle shall be passed on the right.
    """
    speed = max(_length(px, py), TINY)
    ux, uy = px / speed, py / speed
    pair, total, count = 0.0, 0.0, 0
    for other in range(everybody.first[me], everybody.last[me]):
        dx = float(everybody.position[other, 0] - everybody.position[me, 0])
        dy = float(everybody.position[other, 1] - everybody.position[me, 1])
        ahead, left = dx * ux + dy * uy, dy * ux - dx * uy
        if (
            ahead <= 0
            or ahead >= LANE_SIGHT
            or abs(left) >= LANE_WIDE
            or not everybody.walks[other]
        ):
            continue
        if abs(everybody.height[other] - everybody.height[me]) >= STOREY:
            continue
        x, y = float(everybody.preferred[other, 0]), float(everybody.preferred[other, 1])
        fast = max(_length(x, y), TINY)
        if -(x * ux + y * uy) / fast <= OPPOSITE:
            continue
        aside = max(lane - left, 0.0) / max(ahead / (speed + fast), LANE_SOON)
        pair = max(pair, aside * min(max(left + BESIDE, 0.0), 1.0))
        total += aside
        count += 1
    if count == 0:
        return px, py
    stream = total / count * (1 - 1 / count)
    sideways = min(max(pair, stream), LANE_MOST * speed)
    if sideways <= 0:
        return px, py
    x, y = px + sideways * uy, py - sideways * ux
    turned = speed / max(_length(x, y), TINY)
    return float(np.float32(turned * x)), float(np.float32(turned * y))


@inner
def _candidates(wx: float, wy: float, tried: Float) -> None:
    """Velocities to try: the way, a fan around it; the last one and a stop follow."""
    speed = _length(wx, wy)
    # slower than a body can walk well only for those who want to
    least = min(SLOWEST, speed) / max(speed, TINY)
    for k in range(len(FAN)):
        x, y = float(FAN[k, 0]), float(FAN[k, 1])
        length = _length(x, y)
        scale = max(length, least) / length
        tried[k, 0], tried[k, 1] = scale * (x * wx - y * wy), scale * (x * wy + y * wx)


@inner
def _along(everybody: Everybody, me: int, other: int) -> float:
    """Cosine between the directions in which two would walk; 0 if one would not."""
    x, y = float(everybody.preferred[other, 0]), float(everybody.preferred[other, 1])
    px, py = float(everybody.preferred[me, 0]), float(everybody.preferred[me, 1])
    return (x * px + y * py) / max(_length(x, y) * _length(px, py), TINY)


@inner
def _meet(everybody: Everybody, me: int, other: int, left: float, half: float, fan: Fan) -> None:
    """How soon and how nearly one other is met at each velocity of the fan, added to its costs."""
    own_x, own_y = float(everybody.velocity[me, 0]), float(everybody.velocity[me, 1])
    their_x, their_y = float(everybody.velocity[other, 0]), float(everybody.velocity[other, 1])
    to_x = float(everybody.position[other, 0] - everybody.position[me, 0])
    to_y = float(everybody.position[other, 1] - everybody.position[me, 1])
    waited, walks = float(everybody.waited[me]), everybody.walks[other]
    touch, distance = float(everybody.radius[me] + everybody.radius[other]), _length(to_x, to_y)
    # the longer a person has waited, the less room it asks for and the less far it looks ahead:
    # people who all stand .8 m apart could else not move, for fear of a touch seconds later;
    # nor does it ask for more room on the way than where it stops
    room, weight = max(COMFORT / (1 + waited / PUSH), MIN_COMFORT), COLLISION / COMFORT
    room = min(room, max(STANDS_APART, 0.25 * left))
    soon = 1 / max(HORIZON / max(waited / HURRY, 1.0), SHORTEST)
    fast = their_x * their_x + their_y * their_y
    margin = TOUCHES
    if not walks and fast == 0:  # a person that stands will stay there, and can be passed closely
        room, margin = min(room, BESIDE_STANDING / (1 + waited)), TOUCHES / (1 + waited)
    if walks and _along(everybody, me, other) > ALONG:
        room, weight, soon = min(room, BEHIND), COLLISION / FIRM, max(soon, 1 / FOLLOWS)
    if everybody.group[me] > 0 and everybody.group[me] == everybody.group[other]:
        room, weight = IN_GROUP, COLLISION / IN_GROUP
    room += touch
    if half < LANES and walks and _along(everybody, me, other) < -OPPOSITE:
        room = min(room, PASSING)
    # w: velocity relative to the other, reciprocal (2v - own - theirs) where it gives way, too;
    # close by it would be too late to rely on that
    share = 1.0
    if walks and fast > 0.09:
        share += min(max((distance - touch) / CLOSE - 1, 0.0), 1.0)
    # how soon bodies meet that touch is uncertain, since they sway; that nobody goes nearer is not
    next_x, next_y = to_x + REACTION * (their_x - own_x), to_y + REACTION * (their_y - own_y)
    near = max(_length(next_x, next_y), TINY)
    presses = TOUCH * min(max((touch - near) / margin + 1, 0.0), 1.0) / near
    base_x, base_y = (share - 1) * own_x + their_x, (share - 1) * own_y + their_y
    for k in range(WIDE):
        vx, vy = fan.x[k], fan.y[k]
        wx, wy = share * vx - base_x, share * vy - base_y
        # until the body reacts it keeps its velocity
        dx, dy = to_x - REACTION * (own_x - vx), to_y - REACTION * (own_y - vy)
        slowly = 1 / max(wx * wx + wy * wy, 1e-4)
        at = min(max((wx * dx + wy * dy) * slowly, SOON), fan.last[k])
        dx, dy = dx - wx * at, dy - wy * at
        square = dx * dx + dy * dy
        depth = weight * max(room - sqrt(square), 0.0)
        sooner = at - sqrt(max(room * room - square, 0.0) * slowly)
        each = depth * (1 / (0.1 + min(max(sooner * soon, 0.0), 1.0)) - 1 / 1.1)
        each += presses * max(vx * next_x + vy * next_y, 0.0)
        fan.most[k] = max(fan.most[k], each)
        fan.total[k] += each


@compiled
def weigh(
    everybody: Everybody, rows: Index, preferred: Float, left: Float, half: Float, made: Choices
) -> None:
    """What people `rows` [A] may do that would walk at `preferred` [A, 2], into `made`.

    left [A]: metres to where each will stop; half [A]: half the width of its way. Walls are not
    among the costs.
    """
    fan = Fan(np.zeros(WIDE), np.zeros(WIDE), np.zeros(WIDE), np.zeros(WIDE), np.zeros(WIDE))
    urgencies = np.empty(NEIGHBOURS)
    for row in range(len(rows)):
        me, stops, wide = rows[row], float(left[row]), float(half[row])
        slowed = _keep_together(everybody, me, float(preferred[row, 0]), float(preferred[row, 1]))
        made.preferred[row, 0] = slowed * preferred[row, 0]
        made.preferred[row, 1] = slowed * preferred[row, 1]
        px, py = float(made.preferred[row, 0]), float(made.preferred[row, 1])
        near = made.near[row]
        made.known[row] = _neighbours(everybody, me, near, urgencies)
        if everybody.yields[me] > 0:
            px, py = YIELD_SPEED * everybody.retreat[me, 0], YIELD_SPEED * everybody.retreat[me, 1]
        else:
            px, py = _keep_right(everybody, me, px, py, min(LANE, PASS_SHARE * wide))
        last_x, last_y = float(everybody.chosen[me, 0]), float(everybody.chosen[me, 1])
        _candidates(px, py, made.tried[row])
        made.tried[row, TRIED - 2, 0], made.tried[row, TRIED - 2, 1] = last_x, last_y
        made.tried[row, TRIED - 1, 0], made.tried[row, TRIED - 1, 1] = 0.0, 0.0
        for k in range(TRIED):
            fan.x[k], fan.y[k] = made.tried[row, k, 0], made.tried[row, k, 1]
            fan.most[k], fan.total[k] = 0.0, 0.0
            # whom it would meet behind the place where it stops, it does not meet
            stop = stops / max(_length(fan.x[k], fan.y[k]), 1e-3)
            fan.last[k] = min(HORIZON, max(stop, SOON))
        for k in range(made.known[row]):
            _meet(everybody, me, near[k], stops, wide, fan)
        for k in range(TRIED):
            cost = DEVIATION * _length(fan.x[k] - px, fan.y[k] - py)
            cost += CHANGE * _length(fan.x[k] - last_x, fan.y[k] - last_y)
            made.costs[row, k] = cost + (fan.most[k] + 0.25 * fan.total[k])


@inner
def _in_the_way(
    everybody: Everybody, me: int, near: Index, count: int, px: float, py: float
) -> int:
    """Of a lower number, the nearest that stands before one and would come towards one; or -1."""
    pace = max(_length(px, py), TINY)
    for k in range(count):
        other = near[k]
        if not everybody.walks[other] or everybody.number[other] >= everybody.number[me]:
            continue
        dx = float(everybody.position[other, 0] - everybody.position[me, 0])
        dy = float(everybody.position[other, 1] - everybody.position[me, 1])
        distance = _length(dx, dy)
        x, y = float(everybody.preferred[other, 0]), float(everybody.preferred[other, 1])
        speed = max(_length(x, y), TINY)
        towards = -(x * dx + y * dy) / (max(distance, TINY) * speed)
        along = (x * px + y * py) / (speed * pace)
        moves = _length(float(everybody.velocity[other, 0]), float(everybody.velocity[other, 1]))
        slow = moves < 0.5 * speed
        if distance < BLOCKING and towards > FACING and along < OPPOSITE and slow:
            return int(other)
    return -1


@compiled
def decide(everybody: Everybody, rows: Index, made: Choices, seconds: float, found: Next) -> None:
    """Take the choices of least cost, and remember them, into `found`."""
    for row in range(len(rows)):
        me = rows[row]
        costs, least, best = made.costs[row], np.inf, 0
        for k in range(TRIED):
            least = min(least, costs[k])
        while costs[best] > least + EVEN:
            best += 1
        found.velocity[row, 0] = made.tried[row, best, 0]
        found.velocity[row, 1] = made.tried[row, best, 1]
        px, py = float(made.preferred[row, 0]), float(made.preferred[row, 1])
        speed = _length(px, py)
        on = everybody.velocity[me, 0] * px + everybody.velocity[me, 1] * py
        # a person that moves in its own direction does not wait
        waited = everybody.waited[me] + seconds if on / max(speed, TINY) < 0.25 * speed else 0.0
        found.waited[row] = waited
        found.yields[row] = max(everybody.yields[me] - seconds, 0.0)
        found.retreat[row, 0] = everybody.retreat[me, 0]
        found.retreat[row, 1] = everybody.retreat[me, 1]
        if found.waited[row] <= PATIENCE or found.yields[row] > 0:
            continue
        other = _in_the_way(everybody, me, made.near[row], made.known[row], px, py)
        if other < 0:
            continue
        x, y = float(everybody.preferred[other, 0]), float(everybody.preferred[other, 1])
        speed = max(_length(x, y), TINY)
        x, y = x / speed, y / speed
        dx = float(everybody.position[other, 0] - everybody.position[me, 0])
        dy = float(everybody.position[other, 1] - everybody.position[me, 1])
        along = -dx * x - dy * y
        across_x, across_y = -dx - along * x, -dy - along * y
        wide = max(_length(across_x, across_y), TINY)
        x, y = x + across_x / wide, y + across_y / wide
        long = max(_length(x, y), TINY)
        found.waited[row], found.yields[row] = 0.0, YIELDING
        found.retreat[row, 0], found.retreat[row, 1] = x / long, y / long
