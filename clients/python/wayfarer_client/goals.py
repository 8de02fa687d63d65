"""Requests for goals, the same over GoalService and Control."""

from collections.abc import Iterable

from wayfarer_client.behaviours import Behaviour, behaviour_to_wire
from wayfarer_client.errors import InvalidArgument
from wayfarer_client.messages import Agent, Goal, GoalOptions, Place, vector
from wayfarer_client.v1 import goal_pb2


def id_of(agent: Agent | str) -> str:
    """The id of an agent, which may be given as its id."""
    return agent if isinstance(agent, str) else agent.agent_id


def set_goal(
    agent: Agent | str, goal: Goal | Place, expected: int | None, how: GoalOptions
) -> goal_pb2.SetGoalRequest:
    """A goal, or a place and how to walk there.

    `expected`: the agent's revision that this is meant for; any when None. So for all below. Raises
    InvalidArgument.
    """
    if not isinstance(goal, Goal):
        goal = Goal(goal, **how)
    elif how:
        raise InvalidArgument(
            f"{', '.join(how)}: a Goal says itself how to walk there; give it there, or a place"
        )
    return goal_pb2.SetGoalRequest(
        agent_id=id_of(agent), goal=goal.to_wire(), expected_revision=expected
    )


def set_path(
    agent: Agent | str, goals: Iterable[Goal], expected: int | None
) -> goal_pb2.SetPathRequest:
    """Goals to visit in turn."""
    return goal_pb2.SetPathRequest(
        agent_id=id_of(agent),
        goals=[goal.to_wire() for goal in goals],
        expected_revision=expected,
    )


def append_goals(
    agent: Agent | str, goals: Iterable[Goal], expected: int | None
) -> goal_pb2.AppendGoalsRequest:
    """More goals."""
    return goal_pb2.AppendGoalsRequest(
        agent_id=id_of(agent),
        goals=[goal.to_wire() for goal in goals],
        expected_revision=expected,
    )


def wander(
    agent: Agent | str,
    center: Place | None,
    radius: float | None,
    speed: float | None,
    dwell: float | None,
    expected: int | None,
) -> goal_pb2.WanderRequest:
    """Walk about in a disc, or all over the scene. Raises InvalidArgument."""
    if (center is None) != (radius is None):
        raise InvalidArgument(
            "center and radius belong together: give both, or neither to walk all over the scene"
        )
    area = None if center is None else goal_pb2.Area(center=vector(center), radius=radius)
    return goal_pb2.WanderRequest(
        agent_id=id_of(agent),
        area=area,
        speed=speed,
        dwell=dwell,
        expected_revision=expected,
    )


def behave(
    agent: Agent | str, behaviour: Behaviour, expected: int | None
) -> goal_pb2.BehaveRequest:
    """Follow a behaviour until the next goal command."""
    return goal_pb2.BehaveRequest(
        agent_id=id_of(agent),
        behaviour=behaviour_to_wire(behaviour),
        expected_revision=expected,
    )


def clear_goal(agent: Agent | str, expected: int | None) -> goal_pb2.ClearGoalRequest:
    """Stop."""
    return goal_pb2.ClearGoalRequest(agent_id=id_of(agent), expected_revision=expected)
