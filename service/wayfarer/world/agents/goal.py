"""A goal: its fields, their bounds and checks, and goals as columns for the steering."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from wayfarer.config.limits import Limits
from wayfarer.errors import Heading, InvalidArgument, Metres, MetresPerSecond
from wayfarer.world.agents.heading import angle_between, facing_at
from wayfarer.world.ranges import check_place, check_range
from wayfarer.world.rows import Flags, Float, Rows, Shape

RADIUS: Final = (0.05, 10.0)
SPEED: Final = (0.2, 4.0)
DWELL: Final = (0.0, 3600.0)
MAX_HEADING: Final = 100.0
"""A call's is within a turn (`spec.TURN`), and was not in older logs and snapshots, which load."""


@dataclass(frozen=True, slots=True)
class Goal:
    """A place to walk to, and how. The JSON schema takes the ranges from the annotations."""

    position: tuple[float, float, float]  # metres, world; it walks to the ground below it
    # metres: arrived when the pelvis is this near, horizontally
    radius: Annotated[float, RADIUS] = 0.3
    speed: Annotated[float, SPEED] = 1.2  # metres per second, target on the way
    heading: float | None = None  # radians about +Z, 0 faces +Y; to face once stopped there
    stop: bool = True  # False: pass through without slowing; without a next goal, stop after it
    strafe: bool = False  # face `heading` on the way, too: walk sideways or backwards
    # seconds to stand there before the next goal of a path
    dwell: Annotated[float, DWELL] = 0.0


def check_goal(
    goal: Goal,
    start: tuple[float, float, float],
    limits: Limits,
    where: str = "goal",
    whence: str = "the agent",
) -> None:
    """Checks a goal for an agent at `start`; `where` names it in errors. Raises InvalidArgument."""
    if len(goal.position) != 3:
        raise InvalidArgument("position must be x, y, z", f"{where}.position")
    check_place(goal.position[:2], f"{where}.position", goal.position[2])
    check_range([goal.radius], *RADIUS, f"{where}.radius", Metres)
    check_range([goal.speed], *SPEED, f"{where}.speed", MetresPerSecond)
    check_range([goal.dwell], *DWELL, f"{where}.dwell")
    if goal.dwell and not goal.stop:
        raise InvalidArgument("an agent does not dwell where it does not stop", f"{where}.dwell")
    if goal.heading is not None:
        check_range([goal.heading], -MAX_HEADING, MAX_HEADING, f"{where}.heading", Heading)
        if not (goal.stop or goal.strafe):
            raise InvalidArgument(
                "a heading is faced when the agent stops, or with strafe on the way; "
                "this goal asks for neither",
                f"{where}.heading",
            )
    elif goal.strafe:
        raise InvalidArgument("strafe needs a heading to hold on the way", f"{where}.strafe")
    distance = math.dist(goal.position[:2], start[:2])
    if distance > limits.goal_distance_m:
        raise InvalidArgument(
            "goal is {} from {}; allowed: at most {}",
            f"{where}.position",
            Metres(round(distance)),
            whence,
            Metres(limits.goal_distance_m),
        )


def check_path(
    goals: Sequence[Goal],
    start: tuple[float, float, float],
    limits: Limits,
    ahead: int = 0,
    whence: str = "the agent",
    field: str = "goals",
) -> None:
    """Checks goals to visit in turn from `start`, after `ahead` that the agent has already.

    Raises InvalidArgument that names the goal at fault.
    """
    if not 1 <= len(goals) <= limits.path_goals:
        raise InvalidArgument(
            f"a path has {len(goals)} goals; allowed: 1 to {limits.path_goals}", field
        )
    if ahead + len(goals) > limits.path_goals:
        raise InvalidArgument(
            f"{ahead} goals are still ahead and {len(goals)} were added; "
            f"allowed: {limits.path_goals} in all",
            field,
        )
    for number, goal in enumerate(goals):
        check_goal(goal, start, limits, f"{field}[{number}]", whence)
        start, whence = goal.position, "the goal before it"


@dataclass(slots=True)
class GoalColumns(Rows):
    """Goals as columns."""

    given: Flags  # False: no goal, and the other columns mean nothing
    position: Annotated[Float, Shape(3)]
    radius: Float
    speed: Float
    heading: Annotated[Float, Shape(2)]  # unit vector to face, or zero: any
    strafe: Flags  # face the heading on the way, too
    through: Flags  # pass through without stopping
    dwell: Float  # seconds to stand there before the next goal
    more: Flags  # another goal follows
    bend: Float  # radians by which the path turns here
    onward: Annotated[Float, Shape(2)]  # unit vector of the path after here
    tread: Float  # metres from riser to riser if the way leads over stairs; otherwise 0
    close: Flags  # somebody is beside the agent: standing, it does not shift its weight


def goal_columns(goals: Sequence[Goal], start: tuple[float, float]) -> GoalColumns:
    """One row for each goal of a path that is walked from `start`."""
    made = GoalColumns.empty(len(goals))
    made.given[:] = True
    made.position[:] = [goal.position for goal in goals]
    made.radius[:] = [goal.radius for goal in goals]
    made.speed[:] = [goal.speed for goal in goals]
    made.dwell[:] = [goal.dwell for goal in goals]
    made.heading[:] = [(0, 0) if g.heading is None else facing_at(g.heading) for g in goals]
    made.strafe[:] = [goal.strafe for goal in goals]
    made.through[:] = [not goal.stop for goal in goals]
    made.more[:-1] = True
    ways = np.diff(np.concatenate([np.array([start]), made.position[:, :2]]), axis=0)
    ways /= np.maximum(np.linalg.norm(ways, axis=-1, keepdims=True), 1e-6)
    made.onward[:] = np.concatenate([ways[1:], ways[-1:]])  # past the last one, straight on
    made.bend[:] = angle_between(ways, made.onward)
    return made
