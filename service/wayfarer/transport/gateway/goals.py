"""Goal commands of clients, converted to world space."""

from wayfarer.transport.caller import Scope
from wayfarer.transport.convert import in_basis
from wayfarer.transport.gateway.context import GatewayContext, needs
from wayfarer.transport.goal_convert import Wish, fields_named, goal_command


class GoalApi:
    """GoalService."""

    def __init__(self, shared: GatewayContext) -> None:
        self._shared = shared

    @needs(Scope.CONTROL)
    async def give(
        self, agent_id: str, wish: Wish, expected: int | None = None, *, append: bool = False
    ) -> int:
        """Give an agent a goal, a path, or a behaviour; None: stop. Return the new revision.

        `append`: goals are added to the end of the path instead of replacing it. Raises as
        `MotionService.give`: InvalidArgument names the field as the client wrote it, Unreachable
        gives the nearest place in the session's basis.
        """
        basis = (await self._shared.session_of(agent_id)).basis
        command = goal_command(wish, basis, append)
        with fields_named(wish), in_basis(basis.axes):
            return await self._shared.service.give(agent_id, command, expected)
