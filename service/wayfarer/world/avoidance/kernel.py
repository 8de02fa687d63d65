"""The way that a person takes among others, and how fast. Metres, seconds, m/s.

`aim.py` says which ways it may take. The web client's local mode has the same functions by the same
names.
"""

from math import cos, radians, sin, sqrt
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner
from wayfarer.world.rows import Double, Flags, Float, Index, Int

TURNS: Final = (0, 12, -12, 25, -25, 40, -40, 60, -60, 85, -85, 120, -120)
"""Degrees from the preferred direction that are tried, anticlockwise."""
FAN: Final = np.array([(cos(radians(a)), sin(radians(a))) for a in TURNS])
"""The candidates [F, 2], in a frame in which the preferred direction is (1, 0)."""
TRIED: Final = len(FAN) + 2
"""Candidates: the fan, the last direction, a stop."""
WIDE: Final = -(-TRIED // 8) * 8
"""That many numbers fill whole registers; the last ones mean nothing."""

NEIGHBOURS: Final = 10  # of whom a person takes notice at most
HORIZON: Final = 3.5  # seconds that are looked ahead
SHORTEST: Final = 0.7  # least of these, however long a person has waited
SOON: Final = 0.3  # what happens before cannot be helped
CLOSE: Final = 1.5  # nearer nobody relies on others; twice as far, on half of the task
COMFORT: Final = 0.35  # metres of room that one prefers to another one, beside their radii
SHARE: Final = 0.5  # greatest share of the room between them that is preferred
APART: Final = 0.05  # metres: least preferred room, and that within a group
REACTION: Final = 0.3  # seconds until a body follows a new velocity
SLOWEST: Final = 0.5  # m/s: nobody walks well more slowly
SETS_OFF: Final = 0.5  # share of it up to which a person waits instead
HEADWAY: Final = 0.6  # a person's pace is at most the free way divided by these seconds
HEADWAY_AT_DOORS: Final = 0.45  # and where the next metre is narrow somewhere
DEEP: Final = 0.55  # depth of a body on this way, as a share of its width
SQUEEZE: Final = 0.95  # least share of its width that a body needs to pass another one
WAY: Final = (0.2, 0.4, 0.7, 1.0)  # metres at which a way is looked at for walls
WALL_ROOM: Final = 0.1  # preferred between a person's radius and a wall
WALL_SLACK: Final = 0.04  # by which an elbow may be nearer to it
WALL_SHARE: Final = 0.42  # but in a narrow way at most that share of half its width
LANES: Final = 0.9  # half of a way's width within which it has lanes (scenes/lanes.py)
PASSING: Final = 0.3  # metres of room to oncoming people there: they keep to their own lane

DEVIATION: Final = 2.0  # costs, of 1 m/s: not to go where one would
CHANGE: Final = 0.7  # to go elsewhere than last time
COLLISION: Final = 1.8  # to want to go where one would collide at once
WALL: Final = 1.0  # to walk beside a wall
TOUCH: Final = 12.0  # of a metre within another person after `NEXT`
NEXT: Final = 0.5  # seconds
EVEN: Final = 1e-4
"""Costs that differ by no more are equal: the first candidate is taken (1 m/s off the way costs 2).
Left and right often cost the same, and rounding must not choose."""

PUSH: Final = 2.0
"""Seconds of waiting after which a person looks half as far ahead, keeps to the right half as much,
and squeezes past people that walk."""
PATIENCE: Final = 2.5  # seconds of waiting until a person makes way for those before it
YIELDING: Final = 1.6  # seconds for which it does
BLOCKING: Final = 1.6  # metres within which somebody stands in one's way
FACING: Final = 0.3  # cosine from which it would walk towards one

OPPOSITE: Final = 0.5  # cosine from which two walk against each other, or the same way
TINY: Final = 1e-6
FREE: Final = 1e3  # metres: nothing is in the way


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
    spot: Float
    preferred: Float
    chosen: Float
    waited: Float
    yields: Float
    retreat: Float


class Choices(NamedTuple):
    """What some people [A] may do next."""

    preferred: Float  # [A, 2] as their groups have it
    aim: Float  # [A, 2] the same, turned to pass oncoming people or to make way for them
    ways: Float  # [A, C, 2] unit vectors, or zero: where they may go
    free: Double  # [A, C] metres to a wall on these ways
    walls: Double  # [A, C] costs of 1 m/s beside walls
    near: Index  # [A, K] those who matter soonest: rows of everybody, the first `known` of each
    known: Index  # [A]


class Width(NamedTuple):
    """Half of the width of some people's ways [A] in the next metre, in metres; inf: not known."""

    most: Float  # where the way is widest: below `LANES` it has lanes
    least: Float  # where it is narrowest: below `LANES` there is a door, or lanes


class Fan(NamedTuple):
    """The ways [C] that one person tries, and what it thinks of them: room to work in."""

    x: Double
    y: Double
    pace: Double  # m/s at which it would walk there
    last: Double  # seconds that are looked ahead at most
    most: Double  # cost of the worst meeting
    total: Double  # cost of all


class Next(NamedTuple):
    """What they [A] do, and remember of it."""

    velocity: Float  # [A, 2]
    waited: Float
    yields: Float
    retreat: Float  # [A, 2]


@inner
def length(x: float, y: float) -> float:
    """Length of a vector."""
    return sqrt(x * x + y * y)


@inner
def are_against(everybody: Everybody, me: int, other: int) -> bool:
    """Whether the places where two will stand lie in opposite directions."""
    product = 0.0
    for k in range(2):
        mine = float(everybody.spot[me, k] - everybody.position[me, k])
        product += mine * float(everybody.spot[other, k] - everybody.position[other, k])
    return product <= 0


@inner
def _along(everybody: Everybody, me: int, other: int) -> float:
    """Cosine between the directions in which two would walk; 0 if one would not."""
    x, y = float(everybody.preferred[other, 0]), float(everybody.preferred[other, 1])
    px, py = float(everybody.preferred[me, 0]), float(everybody.preferred[me, 1])
    return (x * px + y * py) / max(length(x, y) * length(px, py), TINY)


@inner
def _precedes(everybody: Everybody, me: int, other: int) -> bool:
    """Whether one is more in the way of another one, which goes its way, than that one in its."""
    dx = float(everybody.position[other, 0] - everybody.position[me, 0])
    dy = float(everybody.position[other, 1] - everybody.position[me, 1])
    px, py = float(everybody.preferred[me, 0]), float(everybody.preferred[me, 1])
    x, y = float(everybody.preferred[other, 0]), float(everybody.preferred[other, 1])
    behind = (x * dx + y * dy) / max(length(x, y), TINY)
    behind += (px * dx + py * dy) / max(length(px, py), TINY)
    first = behind < 0 or (behind == 0 and everybody.number[me] < everybody.number[other])
    return first and x * px + y * py > 0


@inner
def _free(
    everybody: Everybody, me: int, other: int, speed: float, headway: float, fan: Fan
) -> None:
    """Slows the ways of the fan on which another person is too near, if it stops or if it walks."""
    own_x, own_y = float(everybody.velocity[me, 0]), float(everybody.velocity[me, 1])
    vx, vy = float(everybody.velocity[other, 0]), float(everybody.velocity[other, 1])
    to_x = float(everybody.position[other, 0] - everybody.position[me, 0])
    to_y = float(everybody.position[other, 1] - everybody.position[me, 1])
    # until the bodies react they keep their velocities
    to_x, to_y = to_x + REACTION * (vx - own_x), to_y + REACTION * (vy - own_y)
    touch = float(everybody.radius[me] + everybody.radius[other])
    if everybody.walks[other]:
        needs = SQUEEZE
        if not _precedes(everybody, me, other):
            needs = max(1 / (1 + float(everybody.waited[me]) / PUSH), SQUEEZE)
        touch *= needs
    for k in range(WIDE):
        ahead, aside = to_x * fan.x[k] + to_y * fan.y[k], to_y * fan.x[k] - to_x * fan.y[k]
        across = max(touch * touch - aside * aside, 0.0)
        gap = ahead - DEEP * sqrt(across) if (across > 0) & (ahead > 0) else FREE
        wx, wy = speed * fan.x[k] - vx, speed * fan.y[k] - vy
        square = max(wx * wx + wy * wy, 1e-4)
        on, beside = to_x * wx + to_y * wy, to_y * wx - to_x * wy
        depth = max(touch * touch * square - beside * beside, 0.0)
        met = speed * (on - sqrt(depth)) / square if (depth > 0) & (on > 0) else FREE
        fan.pace[k] = min(fan.pace[k], min(gap, met) / headway)


@inner
def _meet(everybody: Everybody, me: int, other: int, left: float, half: float, fan: Fan) -> None:
    """How soon and how nearly one other is met at each velocity of the fan, added to its costs."""
    own_x, own_y = float(everybody.velocity[me, 0]), float(everybody.velocity[me, 1])
    their_x, their_y = float(everybody.velocity[other, 0]), float(everybody.velocity[other, 1])
    to_x = float(everybody.position[other, 0] - everybody.position[me, 0])
    to_y = float(everybody.position[other, 1] - everybody.position[me, 1])
    walks = everybody.walks[other]
    touch, distance = float(everybody.radius[me] + everybody.radius[other]), length(to_x, to_y)
    # people who all stand .8 m apart could not move if each asked for more room than that, nor
    # does one ask for more room on the way than where it stops
    room = max(min(COMFORT, SHARE * (distance - touch), 0.25 * left), APART)
    if everybody.group[me] > 0 and everybody.group[me] == everybody.group[other]:
        room = APART
    weight = COLLISION / room
    room += touch
    if half < LANES and walks and _along(everybody, me, other) < -OPPOSITE:
        room = min(room, PASSING)
    # w: velocity relative to the other, reciprocal (2v - own - theirs) where it gives way, too;
    # close by it would be too late to rely on that
    share = 1.0
    if walks and their_x * their_x + their_y * their_y > 0.09:
        share += min(max((distance - touch) / CLOSE - 1, 0.0), 1.0)
    base_x, base_y = (share - 1) * own_x + their_x, (share - 1) * own_y + their_y
    soon = 1 / max(HORIZON / (1 + float(everybody.waited[me]) / PUSH), SHORTEST)
    for k in range(WIDE):
        vx, vy = fan.pace[k] * fan.x[k], fan.pace[k] * fan.y[k]
        wx, wy = share * vx - base_x, share * vy - base_y
        # until the body reacts it keeps its velocity
        dx, dy = to_x - REACTION * (own_x - vx), to_y - REACTION * (own_y - vy)
        slowly = 1 / max(wx * wx + wy * wy, 1e-4)
        at = min(max((wx * dx + wy * dy) * slowly, SOON), fan.last[k])
        dx, dy = dx - wx * at, dy - wy * at
        square = dx * dx + dy * dy
        depth = min(weight * max(room - sqrt(square), 0.0), COLLISION)
        sooner = at - sqrt(max(room * room - square, 0.0) * slowly)
        each = depth * (1 - min(max(sooner * soon, 0.0), 1.0))
        dx, dy = to_x + NEXT * (their_x - vx), to_y + NEXT * (their_y - vy)
        each += TOUCH * max(touch - sqrt(dx * dx + dy * dy), 0.0)
        fan.most[k] = max(fan.most[k], each)
        fan.total[k] += each


@inner
def _best(
    everybody: Everybody, row: int, me: int, left: float, width: Width, made: Choices, fan: Fan
) -> int:
    """The way of least cost of the ones that a person tries. Their paces are in the fan then."""
    px, py = float(made.aim[row, 0]), float(made.aim[row, 1])
    last_x, last_y = float(everybody.chosen[me, 0]), float(everybody.chosen[me, 1])
    speed, half = length(px, py), float(width.most[row])
    headway = HEADWAY_AT_DOORS if width.least[row] < LANES else HEADWAY
    for k in range(TRIED):
        fan.x[k], fan.y[k] = made.ways[row, k, 0], made.ways[row, k, 1]
        fan.pace[k] = min(speed, made.free[row, k] / headway)
        fan.most[k], fan.total[k] = 0.0, 0.0
    for k in range(made.known[row]):
        _free(everybody, me, made.near[row, k], speed, headway, fan)
    slowest = min(SLOWEST, speed)
    for k in range(TRIED):
        waits = fan.pace[k] <= SETS_OFF * slowest or (fan.x[k] == 0 and fan.y[k] == 0)
        fan.pace[k] = 0.0 if waits else max(fan.pace[k], slowest)
        # whom it would meet behind the place where it stops, it does not meet
        fan.last[k] = min(HORIZON, max(left / max(fan.pace[k], 1e-3), SOON))
    for k in range(made.known[row]):
        _meet(everybody, me, made.near[row, k], left, half, fan)
    least, best = np.inf, 0
    for k in range(TRIED):
        x, y = fan.pace[k] * fan.x[k], fan.pace[k] * fan.y[k]
        cost = DEVIATION * length(x - px, y - py)
        if last_x != 0 or last_y != 0:
            cost += CHANGE * length(x - last_x, y - last_y)
        cost += made.walls[row, k] * fan.pace[k] + speed * (fan.most[k] + 0.25 * fan.total[k])
        if cost < least - EVEN:
            least, best = cost, k
    return best


@inner
def _in_the_way(
    everybody: Everybody, me: int, near: Index, count: int, px: float, py: float
) -> int:
    """Of a lower number, the nearest that stands before one and would come towards one; or -1."""
    pace = max(length(px, py), TINY)
    for k in range(count):
        other = near[k]
        if not everybody.walks[other] or everybody.number[other] >= everybody.number[me]:
            continue
        dx = float(everybody.position[other, 0] - everybody.position[me, 0])
        dy = float(everybody.position[other, 1] - everybody.position[me, 1])
        distance = length(dx, dy)
        x, y = float(everybody.preferred[other, 0]), float(everybody.preferred[other, 1])
        speed = max(length(x, y), TINY)
        towards = -(x * dx + y * dy) / (max(distance, TINY) * speed)
        along = (x * px + y * py) / (speed * pace)
        moves = length(float(everybody.velocity[other, 0]), float(everybody.velocity[other, 1]))
        slow = moves < 0.5 * speed
        if (
            distance < BLOCKING
            and towards > FACING
            and along < 0
            and slow
            and are_against(everybody, me, int(other))
        ):
            return int(other)
    return -1


@compiled
def decide(
    everybody: Everybody,
    rows: Index,
    left: Float,
    width: Width,
    seconds: float,
    made: Choices,
    found: Next,
) -> None:
    """Take the ways of least cost, and remember them, into `found`.

    left [A]: metres to where each will stop.
    """
    room = np.zeros((6, WIDE))
    fan = Fan(room[0], room[1], room[2], room[3], room[4], room[5])
    for row in range(len(rows)):
        me = rows[row]
        best = _best(everybody, row, me, float(left[row]), width, made, fan)
        found.velocity[row, 0] = fan.pace[best] * fan.x[best]
        found.velocity[row, 1] = fan.pace[best] * fan.y[best]
        if best == 0 and fan.pace[0] == length(float(made.aim[row, 0]), float(made.aim[row, 1])):
            found.velocity[row] = made.aim[row]  # not even rounding turns it
        px, py = float(made.preferred[row, 0]), float(made.preferred[row, 1])
        speed = length(px, py)
        on = everybody.velocity[me, 0] * px + everybody.velocity[me, 1] * py
        # a person that moves in its own direction does not wait
        waited = everybody.waited[me] + seconds if on / max(speed, TINY) < 0.25 * speed else 0.0
        found.waited[row] = waited
        found.yields[row] = max(everybody.yields[me] - seconds, 0.0)
        found.retreat[row] = everybody.retreat[me]
        if found.waited[row] <= PATIENCE or found.yields[row] > 0:
            continue
        other = _in_the_way(everybody, me, made.near[row], made.known[row], px, py)
        if other < 0:
            continue
        x, y = float(everybody.preferred[other, 0]), float(everybody.preferred[other, 1])
        speed = max(length(x, y), TINY)
        x, y = x / speed, y / speed
        dx = float(everybody.position[other, 0] - everybody.position[me, 0])
        dy = float(everybody.position[other, 1] - everybody.position[me, 1])
        along = -dx * x - dy * y
        across_x, across_y = -dx - along * x, -dy - along * y
        wide = max(length(across_x, across_y), TINY)
        x, y = x + across_x / wide, y + across_y / wide
        long = max(length(x, y), TINY)
        found.waited[row], found.yields[row] = 0.0, YIELDING
        found.retreat[row, 0], found.retreat[row, 1] = x / long, y / long
