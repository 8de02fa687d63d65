"""The commands of GoalService, the same over unary calls and over Control."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Unpack

from google.protobuf.message import Message

from wayfarer_client.behaviours import Behaviour, behaviour_to_wire
from wayfarer_client.errors import InvalidArgument
from wayfarer_client.messages import Agent, Goal, Place, vector
from wayfarer_client.v1 import goal_pb2
from wayfarer_client.v1.fields import GoalFields


def id_of(agent: Agent | str) -> str:
    """The id of an agent, given as an object or as its id."""
    return agent if isinstance(agent, str) else agent.agent_id


def _wired(goal: Goal | Place, **how: Unpack[GoalFields]) -> goal_pb2.Goal:
    return (goal if isinstance(goal, Goal) else Goal(goal, **how)).message


class GoalCommands(ABC):
    """Each command returns the revision that it makes, and raises WayfarerError.

    `expected`: the agent's revision that the command is meant for; None: any. Raises Aborted when
    the agent has another revision by then.
    """

    @abstractmethod
    async def _give(self, request: Message) -> int:
        """Carries out a request of GoalService."""

    async def set_goal(
        self,
        agent: Agent | str,
        goal: Goal | Place,
        *,
        expected: int | None = None,
        **how: Unpack[GoalFields],
    ) -> int:
        """Sends an agent to a goal: a `Goal`, or a place and the other fields of one by name."""
        if isinstance(goal, Goal) and how:
            raise InvalidArgument(
                f"{', '.join(how)}: a Goal says itself how to walk there; give it there, or a place"
            )
        request = goal_pb2.SetGoalRequest(
            agent_id=id_of(agent), goal=_wired(goal, **how), expected_revision=expected
        )
        return await self._give(request)

    async def set_path(
        self, agent: Agent | str, goals: Iterable[Goal | Place], expected: int | None = None
    ) -> int:
        """Sends an agent to goals in turn, in place of what it had."""
        wired = [_wired(goal) for goal in goals]
        request = goal_pb2.SetPathRequest(
            agent_id=id_of(agent), goals=wired, expected_revision=expected
        )
        return await self._give(request)

    async def append_goals(
        self, agent: Agent | str, goals: Iterable[Goal | Place], expected: int | None = None
    ) -> int:
        """Adds goals to the end of an agent's path; its present goal stays."""
        wired = [_wired(goal) for goal in goals]
        request = goal_pb2.AppendGoalsRequest(
            agent_id=id_of(agent), goals=wired, expected_revision=expected
        )
        return await self._give(request)

    async def wander(
        self,
        agent: Agent | str,
        center: Place | None = None,
        radius: float | None = None,
        speed: float | None = None,
        dwell: float | None = None,
        expected: int | None = None,
    ) -> int:
        """Makes an agent wander in a disc or its whole scene, until its next goal command."""
        if (center is None) != (radius is None):
            raise InvalidArgument(
                "center and radius belong together: give both, or neither to walk all over the "
                "scene"
            )
        area = None if center is None else goal_pb2.Area(center=vector(center), radius=radius)
        request = goal_pb2.WanderRequest(
            agent_id=id_of(agent), area=area, speed=speed, dwell=dwell, expected_revision=expected
        )
        return await self._give(request)

    async def behave(
        self, agent: Agent | str, behaviour: Behaviour, expected: int | None = None
    ) -> int:
        """Gives an agent a behaviour that it follows until its next goal command."""
        wired = behaviour_to_wire(behaviour)
        request = goal_pb2.BehaveRequest(
            agent_id=id_of(agent), behaviour=wired, expected_revision=expected
        )
        return await self._give(request)

    async def clear_goal(self, agent: Agent | str, expected: int | None = None) -> int:
        """Stops an agent where it is."""
        request = goal_pb2.ClearGoalRequest(agent_id=id_of(agent), expected_revision=expected)
        return await self._give(request)
