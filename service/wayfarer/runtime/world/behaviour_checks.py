"""What behaviours may be asked for: checks that name the field at fault and what is allowed."""

import math
from typing import Final, assert_never

from wayfarer.errors import Heading, InvalidArgument, Metres, MetresPerSecond
from wayfarer.runtime.agent import Goal
from wayfarer.runtime.behaviours import (
    Activity,
    Behaviour,
    Follow,
    KeepAway,
    Patrol,
    Queue,
    Routine,
    Stand,
    Visit,
    Wander,
)
from wayfarer.runtime.settings import Limits
from wayfarer.runtime.world.checks import (
    MAX_DWELL,
    MAX_HEADING,
    SPEED,
    check_agent_id,
    check_area,
    check_goal,
    check_name,
    check_path,
    check_place,
    check_range,
)

BESIDE: Final = 10.0
"""Metres, either way, between a follower's place and whom it follows …"""
LEAST_BESIDE: Final = 0.5
"""… and the least of them."""
KEPT: Final = (0.5, 50.0)
SPACING: Final = (0.5, 5.0)
MAX_PARTS: Final = 32
MAX_SECONDS: Final = 86_400.0

Start = tuple[float, float, float] | None


def check_behaviour(
    behaviour: Behaviour, start: Start, limits: Limits, where: str = "behaviour"
) -> None:
    """A behaviour for an agent at `start`; None: wherever it is. Raises InvalidArgument."""
    if isinstance(behaviour, Routine):
        _check_routine(behaviour, start, limits, where)
    else:
        _check(behaviour, start, limits, where)


def _check_routine(routine: Routine, start: Start, limits: Limits, where: str) -> None:
    count = len(routine.parts)
    if not 1 <= count <= MAX_PARTS:
        raise InvalidArgument(
            f"a routine has {count} parts; allowed: 1 to {MAX_PARTS}", f"{where}.parts"
        )
    goals = sum(len(p.does.goals) for p in routine.parts if isinstance(p.does, Visit | Patrol))
    if goals > limits.path_goals:
        raise InvalidArgument(
            f"its parts have {goals} goals; allowed: {limits.path_goals} in all", f"{where}.parts"
        )
    for number, part in enumerate(routine.parts):
        at = f"{where}.parts[{number}]"
        check_range([part.seconds], 0, MAX_SECONDS, f"{at}.seconds")
        _check(part.does, start if number == 0 else None, limits, at)
        more = routine.repeat or number < count - 1
        if more and part.seconds == 0 and not isinstance(part.does, Visit):
            raise InvalidArgument(
                "only a visit ends by itself: give the part seconds, or let it be the last one",
                f"{at}.seconds",
            )


def _check(does: Activity, start: Start, limits: Limits, where: str) -> None:
    match does:
        case Wander(center=None):
            check_range([does.speed], *SPEED, f"{where}.speed", MetresPerSecond)
            check_range([does.dwell], 0, MAX_DWELL, f"{where}.dwell")
        case Wander(center=center):
            assert center is not None
            check_area(does, start or center, limits, where)
        case Patrol(goals):
            _check_goals(goals, start, limits, where)
            whence = "the last goal, after which it comes,"
            check_goal(goals[0], goals[-1].position, limits, f"{where}.goals[0]", whence)
        case Visit(goals):
            _check_goals(goals, start, limits, where)
        case Follow():
            _check_follow(does, where)
        case KeepAway():
            _check_keep_away(does, where)
        case Queue():
            check_name(does.name, f"{where}.name", least=1)
            check_place(does.head, f"{where}.head")
            check_range([does.heading], -MAX_HEADING, MAX_HEADING, f"{where}.heading", Heading)
            check_range([does.spacing], *SPACING, f"{where}.spacing", Metres)
            check_range([does.speed], *SPEED, f"{where}.speed", MetresPerSecond)
        case Stand():
            pass
        case never:
            assert_never(never)


def _check_goals(goals: tuple[Goal, ...], start: Start, limits: Limits, where: str) -> None:
    first = start or (goals[0].position if goals else (0.0, 0.0, 0.0))
    check_path(goals, first, limits, field=f"{where}.goals")


def _check_follow(wish: Follow, where: str) -> None:
    check_agent_id(wish.agent_id, f"{where}.agent_id")
    for name in ("behind", "right"):
        check_range([getattr(wish, name)], -BESIDE, BESIDE, f"{where}.{name}", Metres)
    beside = math.hypot(wish.behind, wish.right)
    if beside < LEAST_BESIDE:
        raise InvalidArgument(
            "its place is {} from whom it follows; allowed: {} or more",
            f"{where}.behind",
            Metres(round(beside, 2)),
            Metres(LEAST_BESIDE),
        )


def _check_keep_away(wish: KeepAway, where: str) -> None:
    if (wish.place is None) != bool(wish.agent_id):
        raise InvalidArgument(
            "keep away from an agent or from a place: give exactly one of the two", where
        )
    if wish.place is None:
        check_agent_id(wish.agent_id, f"{where}.agent_id")
    else:
        check_place(wish.place, f"{where}.place")
    check_range([wish.distance], *KEPT, f"{where}.distance", Metres)
    check_range([wish.speed], *SPEED, f"{where}.speed", MetresPerSecond)


def others_of(behaviour: Behaviour) -> list[tuple[str, str]]:
    """Ids of agents that a behaviour names, each with the field that does."""
    if isinstance(behaviour, Routine):
        named = [(_named(part.does), n) for n, part in enumerate(behaviour.parts)]
        return [(agent_id, f"parts[{n}].agent_id") for agent_id, n in named if agent_id]
    agent_id = _named(behaviour)
    return [(agent_id, "agent_id")] if agent_id else []


def _named(does: Activity) -> str:
    return does.agent_id if isinstance(does, Follow | KeepAway) else ""
