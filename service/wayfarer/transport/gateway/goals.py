"""Goals. Every method returns the new revision.

`expected`: the agent's revision that the change is meant for; Aborted is raised at another.
"""

from wayfarer.errors import InvalidArgument
from wayfarer.runtime.agent import Goal
from wayfarer.transport import behaviour_convert, convert, schema
from wayfarer.transport.basis import Basis
from wayfarer.transport.caller import Scope
from wayfarer.transport.gateway.shared import Shared, needs
from wayfarer.transport.scene_convert import in_basis


class GoalApi:
    """GoalService. All methods raise NotFound, InvalidArgument, Aborted; in a scene Unreachable."""

    def __init__(self, shared: Shared) -> None:
        self._shared = shared

    @needs(Scope.CONTROL)
    async def set(self, agent_id: str, wish: schema.Goal, expected: int | None = None) -> int:
        """A goal in place of the present one, or of the path."""
        basis = await self._basis(agent_id)
        with in_basis(basis.axes):
            goal = convert.goal(wish, basis)
            return await self._shared.service.set_goal(agent_id, goal, expected)

    @needs(Scope.CONTROL)
    async def set_path(self, agent_id: str, wish: schema.Goals, expected: int | None = None) -> int:
        """Goals to visit in turn, in place of the present one or the path."""
        basis = await self._basis(agent_id)
        with in_basis(basis.axes):
            goals = self._goals(wish, basis)
            return await self._shared.service.set_path(agent_id, goals, expected)

    @needs(Scope.CONTROL)
    async def append(self, agent_id: str, wish: schema.Goals, expected: int | None = None) -> int:
        """More goals at the end of the path."""
        basis = await self._basis(agent_id)
        with in_basis(basis.axes):
            goals = self._goals(wish, basis)
            return await self._shared.service.append_goals(agent_id, goals, expected)

    @needs(Scope.CONTROL)
    async def wander(self, agent_id: str, wish: schema.Wander, expected: int | None = None) -> int:
        """Walk about until told otherwise."""
        return await self.behave(agent_id, schema.Behaviour(wander=wish), expected)

    @needs(Scope.CONTROL)
    async def behave(
        self, agent_id: str, wish: schema.Behaviour, expected: int | None = None
    ) -> int:
        """Do something of itself until told otherwise. Raises FailedPrecondition, too."""
        basis = await self._basis(agent_id)
        made = behaviour_convert.behaviour(wish, basis)
        with behaviour_convert.fields_named(wish), in_basis(basis.axes):
            return await self._shared.service.behave(agent_id, made, expected)

    @needs(Scope.CONTROL)
    async def clear(self, agent_id: str, expected: int | None = None) -> int:
        """Stop where the agent is."""
        await self._basis(agent_id)
        return await self._shared.service.clear_goal(agent_id, expected)

    async def _basis(self, agent_id: str) -> Basis:
        return (await self._shared.session_of(agent_id)).basis

    def _goals(self, wish: schema.Goals, basis: Basis) -> list[Goal]:
        most = self._shared.limits.path_goals
        if len(wish.goals) > most:
            raise InvalidArgument(
                f"a path has {most} goals at most, not {len(wish.goals)}", "goals"
            )
        return [convert.goal(goal, basis) for goal in wish.goals]
