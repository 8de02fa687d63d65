"""Steering, compiled: the next gait of an agent, and the aim of its next step.

It handles one row at a time; `Steering` explains the numbers, and calls these functions.
"""

from functools import cache
from math import acos, cos, pi, sin, sqrt, tanh
from typing import Final, NamedTuple

import numpy as np

from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Gait, Mode, Seeds
from wayfarer.world.output.turns import bounded, turn
from wayfarer.world.rows import Flags, Float, Int8, columns

STANDING, WALKING, STOPPING, TURNING, STRAFING = (int(mode) for mode in Mode)

TRIM_GAIN: Final = 0.12
"""Share of a speed error that a step adds to the trim."""

TRIM_MOST: Final = 0.15
"""Maximum of the trim, in both directions."""

PACE: Final = 0.7
"""Maximum requested speed, m/s, of which a walker at its goal must keep the share `pausing`."""

FARTHER: Final = 1.5
"""Factor on the way to a point that is aimed at and passed: a body slows down before its goal."""

GONE_BY: Final = 0.2
"""Metres beyond the radius of a point to pass through, within which it counts as passed once a
walker leaves it behind: nobody turns back for so short a distance.
"""

SHIFTS: Final = (13.0, 21.0)
"""Seconds: periods whose sum says when a standing body shifts its weight, 6 to 9 times a minute."""

CALM: Final = 4.0
"""Seconds of standing until it shifts its weight in full."""

STEADY: Final = 0.3
"""Share of the target speed. An agent with a larger error sets off or slows, and has no trim."""


class Targets(NamedTuple):
    """Aims of the next step."""

    place: Float  # [A, 2] metres, in plan, since the model walks on a flat floor
    speed: Float  # [A] m/s
    facing: Float  # [A, 2] unit vector, or zero: the way to the place


class SteeringNumbers(NamedTuple):
    """The numbers of `Steering`, for compiled rules."""

    braking_seconds: float
    braking_margin: float
    coasting_seconds: float
    pausing: float
    slow: float
    slow_seconds: float
    resume_margin: float
    lookahead: float
    lookahead_seconds: float
    faced: float
    astray: float
    turn_radius: float
    turn_speed: float
    climbing: float
    strafe_speed: float
    strafe_slowest: float
    weight_shift: float


class GaitArrays(NamedTuple):
    """The columns of `Gait`, for compiled rules."""

    mode: Int8
    speed: Float
    slow_seconds: Float
    stop_place: Float
    stop_facing: Float
    arrived: Flags
    trim: Float
    rested: Flags


class GoalArrays(NamedTuple):
    """The columns of `GoalColumns`, for compiled rules."""

    given: Flags
    position: Float
    radius: Float
    speed: Float
    heading: Float
    strafe: Flags
    through: Flags
    bend: Float
    onward: Float
    tread: Float
    close: Flags


@inner
def _faces(turns: Float, row: int) -> tuple[float, float]:
    """Horizontal unit vector that a body faces, like `heading.facing_of`; turns [A, S, 22, 4]."""
    x, y, z, w = turn(turns, (row, turns.shape[1] - 1, 0))
    aside, ahead = -2 * (x * y + z * w), 1 - 2 * (y * y + z * z)
    size = max(sqrt(aside * aside + ahead * ahead), 1e-9)
    return aside / size, ahead / size


@inner
def _leans(x: float, y: float, seconds: float) -> float:
    """Where its weight is, from -1 (left) to 1 (right), of a body that stands for `seconds`.

    The place that it stands at says when it begins, so neighbours do not shift together.
    """
    own = 10 * (x + 2 * y)
    first = sin(2 * pi * seconds / SHIFTS[0] + own)
    wave = first + sin(2 * pi * seconds / SHIFTS[1] + 3 * own)
    return min(seconds / CALM, 1.0) * tanh(2 * wave)


@compiled
def decide_rows(
    limits: SteeringNumbers,
    goals: GoalArrays,
    gait: GaitArrays,
    hips: Float,
    turns: Float,
    ready: Flags,
    after: GaitArrays,
) -> None:
    """Writes modes, stops and times into `after`; see `Steering.decide`. hips [A, S, 3] and turns
    [A, S, 22, 4] are the seed's.
    """
    last = hips.shape[1] - 1
    for row in range(len(ready)):
        mode, speed, arrived = gait.mode[row], float(gait.speed[row]), gait.arrived[row]
        goal_x, goal_y = float(goals.position[row, 0]), float(goals.position[row, 1])
        through, radius = goals.through[row], float(goals.radius[row])
        x, y = float(hips[row, last, 0]), float(hips[row, last, 1])
        distance = sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2)
        braking = min(radius / 2, limits.braking_margin) + limits.braking_seconds * speed
        walking = mode in (WALKING, STRAFING)
        stopping, standing, turning = mode == STOPPING, mode == STANDING, mode == TURNING

        is_slow = speed < limits.slow
        slow_seconds = 0.0
        if standing or (stopping and is_slow):
            slow_seconds = float(gait.slow_seconds[row]) + STEP_SECONDS
        still = stopping and slow_seconds >= limits.slow_seconds - 1e-3

        # A passed goal that no goal follows does not hold the agent.
        holds = goals.given[row] and not (through and arrived)
        missed = holds and not arrived
        strayed = holds and distance > max(radius, braking) + limits.resume_margin
        # An agent that comes to rest within reach has arrived; at a slower pace it would only sway.
        paused = mode == WALKING and speed < limits.pausing * min(float(goals.speed[row]), PACE)
        far = distance > braking and (strayed or not (arrived and (is_slow or paused)))
        at_rest = still or standing or turning or (walking and is_slow)

        waits = not ready[row] and gait.rested[row] and is_slow and (standing or mode == WALKING)
        missed, strayed = missed and not waits, strayed and not waits
        walks = (
            (walking and holds and (through or far) and not waits)
            or ((still or standing or turning) and missed)
            or (not walking and strayed)
        )
        face_x, face_y = _faces(turns, row)
        head_x, head_y = float(goals.heading[row, 0]), float(goals.heading[row, 1])
        has_heading = goals.given[row] and (head_x != 0 or head_y != 0) and not waits
        off = acos(bounded(face_x * head_x + face_y * head_y, -1.0, 1.0))
        astray = has_heading and off > (limits.faced if turning else limits.astray)
        turns_now = at_rest and astray and not walks
        stands = waits or ((standing or still) and not walks and not turns_now)
        if walks:
            after.mode[row] = STRAFING if goals.strafe[row] else WALKING
        elif turns_now:
            after.mode[row] = TURNING
        else:
            after.mode[row] = STANDING if stands else STOPPING
        after.rested[row], after.slow_seconds[row] = stands, slow_seconds

        # Without a goal an agent stops as soon as it can; then it stands where it came to rest.
        brakes, rests = walking and not walks and not waits, still and not walks
        # An agent that rests at the edge of a goal moves inward, or it would sway out of reach.
        edges = rests and holds and distance > radius / 2
        # The steps of a turn at a goal take an agent nearer to it.
        if (
            edges
            or (turns_now and holds and arrived)
            or (brakes and holds and not (rests or (turning and not turns_now)))
        ):
            after.stop_place[row, 0], after.stop_place[row, 1] = goal_x, goal_y
        elif rests or (turning and not turns_now):
            after.stop_place[row, 0], after.stop_place[row, 1] = x, y
        elif brakes:
            way_x, way_y = x - float(hips[row, 0, 0]), y - float(hips[row, 0, 1])
            more = limits.coasting_seconds * speed / max(sqrt(way_x**2 + way_y**2), 1e-6)
            after.stop_place[row, 0] = x + more * way_x
            after.stop_place[row, 1] = y + more * way_y
        # A stopping agent keeps its facing, unless another heading is asked for.
        if has_heading and not walks:
            after.stop_facing[row, 0], after.stop_facing[row, 1] = head_x, head_y
        elif brakes or rests:
            after.stop_facing[row, 0], after.stop_facing[row, 1] = face_x, face_y


@compiled
def aim_rows(
    limits: SteeringNumbers,
    goals: GoalArrays,
    gait: GaitArrays,
    hips: Float,
    turns: Float,
    found: Targets,
) -> None:
    """Writes aims into `found`; see `Steering.targets`."""
    last = hips.shape[1] - 1
    for row in range(len(gait.mode)):
        mode = gait.mode[row]
        place_x, place_y = float(gait.stop_place[row, 0]), float(gait.stop_place[row, 1])
        facing_x, facing_y = float(gait.stop_facing[row, 0]), float(gait.stop_facing[row, 1])
        speed = 0.0
        if mode in (WALKING, STRAFING):
            # the goal or, near a goal to pass through, a point beyond it, so that nobody slows to
            # meet it; where the path turns the point is nearer, so that no corner is cut
            place_x, place_y = float(goals.position[row, 0]), float(goals.position[row, 1])
            asked = float(goals.speed[row])
            if goals.through[row]:
                to_x, to_y = place_x - hips[row, last, 0], place_y - hips[row, last, 1]
                sight = max(limits.lookahead, limits.lookahead_seconds * asked)
                beyond = sight * cos(float(goals.bend[row])) - sqrt(to_x * to_x + to_y * to_y)
                # An agent that has missed it turns back: the point beyond would be at its own feet.
                is_past = to_x * goals.onward[row, 0] + to_y * goals.onward[row, 1] <= 0
                if not is_past:
                    to_x += goals.onward[row, 0] * max(beyond, 0.0)
                    to_y += goals.onward[row, 1] * max(beyond, 0.0)
                    place_x = float(hips[row, last, 0]) + FARTHER * to_x
                    place_y = float(hips[row, last, 1]) + FARTHER * to_y
            facing_x = facing_y = 0.0
            if mode == STRAFING:
                facing_x, facing_y = float(goals.heading[row, 0]), float(goals.heading[row, 1])
            speed = asked * (1 + float(gait.trim[row]))
            if goals.strafe[row]:
                speed = max(speed, limits.strafe_slowest)
            if goals.tread[row] > 0:
                speed = min(speed, limits.climbing * float(goals.tread[row]))
            elif goals.strafe[row]:
                speed = min(speed, limits.strafe_speed)
            speed = max(speed, 0.0)
        elif mode == TURNING:
            face_x, face_y = _faces(turns, row)
            arc_x, arc_y = face_x + facing_x, face_y + facing_y
            wide = limits.turn_radius / max(sqrt(arc_x * arc_x + arc_y * arc_y), 0.1)
            place_x, place_y = place_x + wide * arc_x, place_y + wide * arc_y
            speed = limits.turn_speed
        elif mode == STANDING and not goals.close[row]:
            leans = _leans(place_x, place_y, float(gait.slow_seconds[row]))
            place_x += limits.weight_shift * leans * facing_y
            place_y -= limits.weight_shift * leans * facing_x
        found.place[row, 0], found.place[row, 1], found.speed[row] = place_x, place_y, speed
        found.facing[row, 0], found.facing[row, 1] = facing_x, facing_y


@compiled
def observe_rows(goals: GoalArrays, hips: Float, start: Float, gait: GaitArrays) -> None:
    """Writes speeds, trims and arrivals into `gait`."""
    last = hips.shape[1] - 1
    for row in range(len(hips)):
        radius, there = float(goals.radius[row]), False
        goal_x, goal_y = float(goals.position[row, 0]), float(goals.position[row, 1])
        away = sqrt((start[row, 0] - goal_x) ** 2 + (start[row, 1] - goal_y) ** 2)
        walks = gait.mode[row] in (WALKING, STRAFING)
        for frame in range(last + 1):
            x, y = float(hips[row, frame, 0]) - goal_x, float(hips[row, frame, 1]) - goal_y
            before, away = away, sqrt(x * x + y * y)
            leaves = goals.through[row] and walks and away > before
            there = there or away <= radius + (GONE_BY if leaves else 0.0)
        x = float(hips[row, last, 0]) - float(start[row, 0])
        y = float(hips[row, last, 1]) - float(start[row, 1])
        speed = sqrt(x * x + y * y) / STEP_SECONDS
        lacks = 1 - speed / max(float(goals.speed[row]), 1e-3)
        trim = float(gait.trim[row])
        if goals.given[row] and walks and abs(lacks) < STEADY:
            trim += TRIM_GAIN * lacks
        gait.trim[row] = bounded(trim, -TRIM_MOST, TRIM_MOST)
        gait.speed[row] = speed
        gait.arrived[row] = gait.arrived[row] or (goals.given[row] and there)


@cache
def prepare() -> None:
    """Compiles the rules, or loads them, before agents walk."""
    limits, seed = SteeringNumbers(*[0.0] * len(SteeringNumbers._fields)), Seeds.empty(1)
    goals, gait = columns(GoalArrays, GoalColumns.empty(1)), columns(GaitArrays, Gait.empty(1))
    hips, turns, ready = seed.translation, seed.rotations, np.ones(1, np.bool_)
    warm(decide_rows, limits, goals, gait, hips, turns, ready, gait)
    found = Targets(np.empty((1, 2), np.float32), np.empty(1, np.float32), gait.stop_facing)
    warm(aim_rows, limits, goals, gait, hips, turns, found)
    warm(observe_rows, goals, hips, hips[0], gait)
