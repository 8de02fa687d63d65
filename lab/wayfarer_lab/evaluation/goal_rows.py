"""Rows of `eval arrival`: near goals, speeds, turns, waypoints, changed goals, strafing.

Each is a pure function of courses (`goals.Course`) and gives one row. Frames count from the
first one made for the order; *primitives* are counted as in `outcome`.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.world.agents.heading import facing_at
from wayfarer_lab.evaluation.figures import (
    degrees_off,
    distances,
    first,
    mean,
    median_of_all,
    primitives,
    quantile,
    share,
    smooth_speed,
)
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.goals import Course
from wayfarer_lab.evaluation.metrics.kinematics import travel_speed
from wayfarer_lab.evaluation.outcome import NEAR, REACHED, STEP_LIMIT

Array = NDArray[np.floating[Any]]

SOON: Final = 15
"""Primitives within which a near goal should be reached, or a turn be done."""

CRUISE_AFTER: Final = 2 * FPS
"""Frames from the order until an agent has its speed: 2 s."""

CRUISE_BEFORE: Final = 2.0
"""Metres before the goal within which an agent may slow down."""

FACED: Final = 15.0
"""Degrees within which a heading is met."""

HEADED: Final = 30.0
"""Degrees between facing and way to the goal, up to which an agent heads towards it."""

DIP: Final = FPS
"""Frames on either side of passing a waypoint in which the speed may dip: 1 s."""


def near_row(name: str, courses: Sequence[Course]) -> Row:
    """When hips come within 0.3 m of a near goal. Agents that never do are sorted last."""
    steps = [primitives(_reaches(course, NEAR)) for course in courses]
    return {
        "name": name,
        "agents": len(courses),
        "reached_15": share([s <= SOON for s in steps]),
        "success_03m": share([not np.isnan(s) for s in steps]),
        "steps_median": median_of_all(steps),
    }


def speed_row(name: str, courses: Sequence[Course]) -> Row:
    """Mean speed on the way and its target, from 2 s after the order to 2 m before the
    goal; the error is of each agent's mean.
    """
    target = courses[0].goal.speed
    speeds = [_cruise(course) for course in courses]
    return {
        "name": name,
        "agents": len(courses),
        "wished_mps": target,
        "speed_mps": mean(speeds),
        "speed_error_mps": mean([abs(speed - target) for speed in speeds]),
        "speed_error_p90_mps": quantile([abs(speed - target) for speed in speeds], 0.9),
    }


def turn_row(name: str, courses: Sequence[Course]) -> Row:
    """Turning on the spot: time until the heading is within 15° of the target, and drift.

    Errors are those of the last frame; the drift is the farthest that hips were from the place.
    """
    off = [_off_heading(course) for course in courses]
    drift = [float(distances(c.hips, c.goal).max()) for c in courses]
    faced = [primitives(first(o <= FACED)) for o in off]
    return {
        "name": name,
        "agents": len(courses),
        "faced_15": share([f <= SOON for f in faced]),
        "steps_median": median_of_all(faced),
        "facing_error_median_deg": quantile([float(o[-1]) for o in off], 0.5),
        "facing_error_p90_deg": quantile([float(o[-1]) for o in off], 0.9),
        "drift_mean_m": mean(drift),
        "drift_max_m": max(drift),
    }


def waypoint_row(name: str, courses: Sequence[Course]) -> Row:
    """Passing through the waypoints of a path.

    `passed`: share of waypoints that hips came within the radius of. `speed_kept`: slowest speed
    (over 0.5 s) within 1 s of the nearest approach ÷ median speed between the waypoints.
    """
    passed, misses, kept = [], [], []
    for course in courses:
        path = course.given[-1].path
        approach = np.stack([distances(course.hips, goal) for goal in path[:-1]])
        speed = smooth_speed(course.hips)
        over = first(distances(course.hips, path[-1]) <= CRUISE_BEFORE) or len(speed)
        nearest = approach[:, :over].argmin(-1)
        time = np.arange(over)
        passing = np.abs(time - nearest[:, None]) <= DIP
        cruise = np.median(speed[:over][(time >= CRUISE_AFTER) & ~passing.any(0)])
        for goal, metres, around in zip(path[:-1], approach[:, :over], passing, strict=True):
            passed.append(bool(metres.min() <= goal.radius))
            misses.append(float(metres.min()))
            kept.append(float(speed[:over][around].min() / cruise))
    return {
        "name": name,
        "agents": len(courses),
        "passed": share(passed),
        "missed_by_m": mean(misses),
        "speed_kept_mean": mean(kept),
        "speed_kept_p10": quantile(kept, 0.1),
        "success_03m": share([bool((distances(c.hips, c.goal) <= NEAR).any()) for c in courses]),
    }


def change_row(name: str, courses: Sequence[Course]) -> Row:
    """A new goal while walking: time until the body faces it within 30°, and until it arrives.

    `detour`: metres walked until the goal is reached ÷ metres straight to it.
    """
    headed, steps, detour = [], [], []
    for course in (course.latest() for course in courses):
        way = np.asarray(course.goal.position)[:2] - course.hips[:, :2]
        length = np.linalg.norm(way, axis=-1, keepdims=True)
        off = degrees_off(course.facing, way / length.clip(1e-6))
        headed.append(primitives(first(off <= HEADED)))
        reached = _reaches(course, REACHED)
        steps.append(primitives(reached))
        if reached is not None:
            walked = np.linalg.norm(np.diff(course.hips[: reached + 1, :2], axis=0), axis=-1).sum()
            detour.append(float(walked / max(length[0, 0] - REACHED, 1e-6)))
    return {
        "name": name,
        "agents": len(courses),
        "steps_headed_median": median_of_all(headed),
        "steps_median": median_of_all(steps),
        "success": share([not np.isnan(s) for s in steps]),
        "success_03m": share([_reaches(course, NEAR) is not None for course in courses]),
        "detour": mean(detour),
    }


def strafe_row(name: str, courses: Sequence[Course]) -> Row:
    """Facing on the way to a goal, from 1 s after the order until it is reached (0.75 m)."""
    off, speeds = [], []
    for course in courses:
        way = slice(FPS, _reaches(course, REACHED) or STEP_LIMIT * NEW_FRAMES)
        off += _off_heading(course)[way].tolist()
        speeds.append(_speed(course.hips[way]))
    return {
        "name": name,
        "agents": len(courses),
        "facing_error_mean_deg": mean(off),
        "facing_error_p90_deg": quantile(off, 0.9),
        "success": share([_reaches(course, REACHED) is not None for course in courses]),
        "success_03m": share([_reaches(course, NEAR) is not None for course in courses]),
        "steps_median": median_of_all([primitives(_reaches(c, REACHED)) for c in courses]),
        "speed_mps": mean(speeds),
    }


def _reaches(course: Course, metres: float) -> int | None:
    """First frame within 60 primitives of the last order and `metres` of its last goal."""
    hips = course.latest().hips[: STEP_LIMIT * NEW_FRAMES]
    return first(distances(hips, course.goal) <= metres)


def _off_heading(course: Course) -> Array:
    """Degrees from the target heading, from the last order on. [T]"""
    heading = course.goal.heading
    if heading is None:
        raise InvalidArgument("this manoeuvre is judged by a heading, and none was asked for")
    return degrees_off(course.latest().facing, facing_at(heading))


def _cruise(course: Course) -> float:
    """Mean speed between start and braking; NaN when the way is too short."""
    end = first(distances(course.hips, course.goal) <= CRUISE_BEFORE)
    return _speed(course.hips[CRUISE_AFTER:end])


def _speed(hips: Array) -> float:
    return float(travel_speed(hips)) if len(hips) > FPS else float("nan")
