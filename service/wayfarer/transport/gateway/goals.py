"""Goal commands of clients, converted to world space."""

from wayfarer.transport import schema
from wayfarer.transport.conversion.convert import in_basis
from wayfarer.transport.conversion.goal_convert import CommandRequest, fields_named, goal_command
from wayfarer.transport.gateway.context import GatewayContext, implements


class GoalApi:
    """GoalService. Each call returns the new revision.

    All raise what `MotionService.give` raises. InvalidArgument names the field as the client wrote
    it; Unreachable has the nearest place in the session's basis.
    """

    def __init__(self, context: GatewayContext) -> None:
        self._context = context

    @implements("SetGoal")
    async def set_goal(
        self, agent_id: str, goal: schema.Goal, expected_revision: int | None = None
    ) -> schema.GoalRevision:
        """Replaces the agent's goal, path or behaviour with a goal."""
        return await self._give(agent_id, goal, expected_revision)

    @implements("SetPath")
    async def set_path(
        self, agent_id: str, path: schema.Goals, expected_revision: int | None = None
    ) -> schema.GoalRevision:
        """Replaces the agent's goal, path or behaviour with goals to visit in turn."""
        return await self._give(agent_id, path, expected_revision)

    @implements("AppendGoals")
    async def append_goals(
        self, agent_id: str, more: schema.Goals, expected_revision: int | None = None
    ) -> schema.GoalRevision:
        """Adds goals to the end of the path."""
        return await self._give(agent_id, more, expected_revision, append=True)

    @implements("Wander")
    async def wander(
        self, agent_id: str, request: schema.Wander, expected_revision: int | None = None
    ) -> schema.GoalRevision:
        """Replaces the agent's goal, path or behaviour with the behaviour `wander`."""
        return await self._give(agent_id, request, expected_revision)

    @implements("Behave")
    async def behave(
        self, agent_id: str, behaviour: schema.Behaviour, expected_revision: int | None = None
    ) -> schema.GoalRevision:
        """Replaces the agent's goal, path or behaviour with a behaviour."""
        return await self._give(agent_id, behaviour, expected_revision)

    @implements("ClearGoal")
    async def clear_goal(
        self, agent_id: str, expected_revision: int | None = None
    ) -> schema.GoalRevision:
        """Removes the agent's goal, path or behaviour, so that it stops."""
        return await self._give(agent_id, None, expected_revision)

    async def _give(
        self, agent_id: str, request: CommandRequest, expected: int | None, append: bool = False
    ) -> schema.GoalRevision:
        basis = (await self._context.session_of(agent_id)).basis
        command = goal_command(request, basis, append)
        with fields_named(request), in_basis(basis.axes):
            number = await self._context.service.give(agent_id, command, expected)
        return schema.GoalRevision(revision=number)
