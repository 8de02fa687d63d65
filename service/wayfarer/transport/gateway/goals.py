"""Goal commands of clients, converted to world space."""

from wayfarer.transport import schema, wire
from wayfarer.transport.caller import Scope
from wayfarer.transport.convert import in_basis
from wayfarer.transport.gateway.context import GatewayContext, needs
from wayfarer.transport.goal_convert import Wish, fields_named, goal_command
from wayfarer.v1 import goal_pb2

GoalRequest = (
    goal_pb2.SetGoalRequest
    | goal_pb2.SetPathRequest
    | goal_pb2.AppendGoalsRequest
    | goal_pb2.WanderRequest
    | goal_pb2.BehaveRequest
    | goal_pb2.ClearGoalRequest
)


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

    @needs(Scope.CONTROL)
    async def carry_out(self, request: GoalRequest) -> int:
        """Carry out a request of GoalService, from gRPC or Control; return the new revision.

        Raises as `give`.
        """
        expected = request.expected_revision if request.HasField("expected_revision") else None
        wish: Wish
        match request:
            case goal_pb2.SetGoalRequest():
                wish = wire.parse(schema.Goal, request.goal, "goal")
            case goal_pb2.SetPathRequest() | goal_pb2.AppendGoalsRequest():
                wish = wire.parse(schema.Goals, request)
            case goal_pb2.WanderRequest():
                wish = wire.parse(schema.Wander, request)
            case goal_pb2.BehaveRequest():
                wish = wire.parse(schema.Behaviour, request.behaviour, "behaviour")
            case goal_pb2.ClearGoalRequest():
                wish = None
        append = isinstance(request, goal_pb2.AppendGoalsRequest)
        return await self.give(request.agent_id, wish, expected, append=append)
