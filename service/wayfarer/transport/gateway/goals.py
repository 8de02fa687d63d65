"""Goal commands of clients, converted to world space."""

from wayfarer.transport import schema, wire
from wayfarer.transport.caller import Scope
from wayfarer.transport.convert import in_basis
from wayfarer.transport.gateway.context import GatewayContext, needs
from wayfarer.transport.goal_convert import CommandRequest, fields_named, goal_command
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

    def __init__(self, context: GatewayContext) -> None:
        self._context = context

    @needs(Scope.CONTROL)
    async def give(
        self,
        agent_id: str,
        request: CommandRequest,
        expected: int | None = None,
        *,
        append: bool = False,
    ) -> int:
        """Give an agent a goal, a path, or a behaviour; None: stop. Return the new revision.

        `append`: goals are added to the end of the path instead of replacing it. Raises as
        `MotionService.give`: InvalidArgument names the field as the client wrote it, Unreachable
        gives the nearest place in the session's basis.
        """
        basis = (await self._context.session_of(agent_id)).basis
        command = goal_command(request, basis, append)
        with fields_named(request), in_basis(basis.axes):
            return await self._context.service.give(agent_id, command, expected)

    @needs(Scope.CONTROL)
    async def carry_out(self, request: GoalRequest) -> int:
        """Carry out a request of GoalService, from gRPC or Control; return the new revision.

        Raises as `give`.
        """
        expected = request.expected_revision if request.HasField("expected_revision") else None
        parsed: CommandRequest
        match request:
            case goal_pb2.SetGoalRequest():
                parsed = wire.parse(schema.Goal, request.goal, "goal")
            case goal_pb2.SetPathRequest() | goal_pb2.AppendGoalsRequest():
                parsed = wire.parse(schema.Goals, request)
            case goal_pb2.WanderRequest():
                parsed = wire.parse(schema.Wander, request)
            case goal_pb2.BehaveRequest():
                parsed = wire.parse(schema.Behaviour, request.behaviour, "behaviour")
            case goal_pb2.ClearGoalRequest():
                parsed = None
        append = isinstance(request, goal_pb2.AppendGoalsRequest)
        return await self.give(request.agent_id, parsed, expected, append=append)
