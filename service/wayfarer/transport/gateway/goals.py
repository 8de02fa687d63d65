"""Goals. Every method returns the new revision.

`expected`: the agent's revision that the change is meant for; Aborted is raised at another.
"""

from wayfarer.errors import InvalidArgument
from wayfarer.runtime.agent import Goal
from wayfarer.transport import convert, schema
from wayfarer.transport.basis import Basis
from wayfarer.transport.caller import Scope
from wayfarer.transport.gateway.shared import Shared, needs


class GoalApi:
    """GoalService. All methods raise NotFound, InvalidArgument, Aborted."""

    def __init__(self, shared: Shared) -> None:
        self._shared = shared

    @needs(Scope.CONTROL)
    async def set(self, agent_id: str, wish: schema.Goal, expected: int | None = None) -> int:
        """A goal in place of the present one, or of the path."""
        goal = convert.goal(wish, self._basis(agent_id))
        return await self._shared.service.set_goal(agent_id, goal, expected)

    @needs(Scope.CONTROL)
    async def set_path(self, agent_id: str, wish: schema.Goals, expected: int | None = None) -> int:
        """Goals to visit in turn, in place of the present one or the path."""
        goals = self._goals(agent_id, wish)
        return await self._shared.service.set_path(agent_id, goals, expected)

    @needs(Scope.CONTROL)
    async def append(self, agent_id: str, wish: schema.Goals, expected: int | None = None) -> int:
        """More goals at the end of the path."""
        goals = self._goals(agent_id, wish)
        return await self._shared.service.append_goals(agent_id, goals, expected)

    @needs(Scope.CONTROL)
    async def wander(self, agent_id: str, wish: schema.Wander, expected: int | None = None) -> int:
        """Walk about in an area until told otherwise."""
        area = convert.wander(wish, self._basis(agent_id))
        return await self._shared.service.wander(agent_id, area, expected)

    @needs(Scope.CONTROL)
    async def clear(self, agent_id: str, expected: int | None = None) -> int:
        """Stop where the agent is."""
        self._basis(agent_id)
        return await self._shared.service.clear_goal(agent_id, expected)

    def _basis(self, agent_id: str) -> Basis:
        return self._shared.book.session_of(agent_id).basis

    def _goals(self, agent_id: str, wish: schema.Goals) -> list[Goal]:
        basis, most = self._basis(agent_id), self._shared.limits.path_goals
        if len(wish.goals) > most:
            raise InvalidArgument(
                f"a path has {most} goals at most, not {len(wish.goals)}", "goals"
            )
        return [convert.goal(goal, basis) for goal in wish.goals]
