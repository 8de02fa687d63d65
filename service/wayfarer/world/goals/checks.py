"""What callers may ask for: checks that name the field at fault and what is allowed."""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from typing import Final

from wayfarer.errors import Heading, InvalidArgument, Metres, MetresPerSecond, Place
from wayfarer.limits import Limits
from wayfarer.spec import BETAS, GENDERS, MAX_COORDINATE
from wayfarer.world.agents.agent import AgentChange, AgentSpec, Goal, SessionSpec

RADIUS: Final = (0.05, 10.0)
SPEED: Final = (0.2, 4.0)
MAX_DWELL: Final = 3600.0
MAX_HEADING: Final = 100.0
MAX_BETA: Final = 5.0
MAX_NAME: Final = 64
ID: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def check_session_id(session_id: str) -> None:
    """Raises InvalidArgument."""
    _check_id(session_id, "session_id", "session_id")


def check_session(spec: SessionSpec) -> None:
    """Raises InvalidArgument."""
    if spec.session_id is not None:
        check_session_id(spec.session_id)
    _check_seed(spec.seed, "seed")


def check_agent_id(agent_id: str, where: str) -> None:
    """Raises InvalidArgument."""
    _check_id(agent_id, "agent_id", where)


def check_spec(spec: AgentSpec, where: str) -> None:
    """`where` names the spec in messages, e.g. `agents[2]`. Raises InvalidArgument."""
    if spec.gender not in GENDERS:
        raise InvalidArgument(
            f"gender is {spec.gender!r}; allowed: {', '.join(GENDERS)}", f"{where}.gender"
        )
    if len(spec.betas) != BETAS:
        raise InvalidArgument(f"needs {BETAS} betas, got {len(spec.betas)}", f"{where}.betas")
    check_range(spec.betas, -MAX_BETA, MAX_BETA, f"{where}.betas")
    check_place(spec.position, f"{where}.position", spec.floor)
    check_range([spec.heading], -MAX_COORDINATE, MAX_COORDINATE, f"{where}.heading", Heading)
    _check_seed(spec.noise_seed, f"{where}.noise_seed")
    check_name(spec.name, f"{where}.name")


def check_specs(specs: Sequence[AgentSpec]) -> None:
    """Check agents to be created together. Raises InvalidArgument."""
    for number, spec in enumerate(specs):
        check_spec(spec, f"agents[{number}]")


def check_change(change: AgentChange) -> None:
    """Raises InvalidArgument."""
    if change.name is not None:
        check_name(change.name, "name")


def check_goal(
    goal: Goal,
    start: tuple[float, float, float],
    limits: Limits,
    where: str = "goal",
    whence: str = "the agent",
) -> None:
    """A goal for an agent at `start`. `where` names it in messages. Raises InvalidArgument."""
    if len(goal.position) != 3:
        raise InvalidArgument("position must be x, y, z", f"{where}.position")
    check_place(goal.position[:2], f"{where}.position", goal.position[2])
    check_range([goal.radius], *RADIUS, f"{where}.radius", Metres)
    check_range([goal.speed], *SPEED, f"{where}.speed", MetresPerSecond)
    check_range([goal.dwell], 0, MAX_DWELL, f"{where}.dwell")
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
    """Goals to visit in turn from `start`, after `ahead` that the agent has already.

    Raises InvalidArgument that names the one at fault.
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


def _check_id(value: str, name: str, field: str) -> None:
    if not ID.fullmatch(value):
        raise InvalidArgument(
            f"{name} must be 1 to 64 of A-Z a-z 0-9 . _ -, beginning with a letter or digit", field
        )


def _check_seed(seed: int, field: str) -> None:
    if not 0 <= seed < 2**64:
        raise InvalidArgument(f"{field} must lie in [0, 2^64)", field)


def check_name(name: str, field: str, least: int = 0) -> None:
    """Raises InvalidArgument."""
    if not least <= len(name) <= MAX_NAME:
        raise InvalidArgument(
            f"name has {len(name)} characters; allowed: {least} to {MAX_NAME} characters", field
        )


def check_place(place: tuple[float, ...], field: str, height: float = 0.0) -> None:
    """A place on the floor, or at a height. Raises InvalidArgument."""
    if len(place) != 2:
        raise InvalidArgument("must be x, y on the floor", field)
    point = (*place, height)
    if not all(-MAX_COORDINATE <= value <= MAX_COORDINATE for value in point):  # a NaN fails too
        raise InvalidArgument(
            "{} is {}; allowed: at most {} from the origin along each axis",
            field,
            field,
            Place(point),
            Metres(MAX_COORDINATE),
        )


def check_range(
    values: Iterable[float],
    low: float,
    high: float,
    field: str,
    kind: Callable[[float], object] = "{:g}".format,
) -> None:
    """Finite numbers within these limits; `kind`: of quantity. Raises InvalidArgument."""
    for value in values:
        if not low <= value <= high:  # a NaN fails too
            raise InvalidArgument(
                "{} holds {}; allowed: {} to {}", field, field, kind(value), kind(low), kind(high)
            )
