"""The requests of GoalService, which arrive by gRPC and over Control."""

from wayfarer.transport import schema, wire
from wayfarer.transport.gateway.goals import GoalApi
from wayfarer.transport.goal_convert import Wish
from wayfarer.v1 import goal_pb2

GoalRequest = (
    goal_pb2.SetGoalRequest
    | goal_pb2.SetPathRequest
    | goal_pb2.AppendGoalsRequest
    | goal_pb2.WanderRequest
    | goal_pb2.BehaveRequest
    | goal_pb2.ClearGoalRequest
)


async def give(request: GoalRequest, goals: GoalApi) -> int:
    """Carry out a request; return the new revision. Raises NotFound, InvalidArgument, Aborted."""
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
    return await goals.give(request.agent_id, wish, expected, append=append)
