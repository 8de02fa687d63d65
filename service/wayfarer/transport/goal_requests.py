"""The requests of GoalService, as they come by gRPC and over Control."""

from wayfarer.transport import schema, wire
from wayfarer.transport.gateway.goals import GoalApi
from wayfarer.v1 import goal_pb2

GoalRequest = (
    goal_pb2.SetGoalRequest
    | goal_pb2.SetPathRequest
    | goal_pb2.AppendGoalsRequest
    | goal_pb2.WanderRequest
    | goal_pb2.BehaveRequest
    | goal_pb2.ClearGoalRequest
)


async def carry_out(request: GoalRequest, goals: GoalApi) -> int:
    """Do what it says; the new revision. Raises NotFound, InvalidArgument, Aborted."""
    expected = request.expected_revision if request.HasField("expected_revision") else None
    agent_id = request.agent_id
    match request:
        case goal_pb2.SetGoalRequest():
            goal = wire.parse(schema.Goal, request.goal, "goal")
            return await goals.set(agent_id, goal, expected)
        case goal_pb2.SetPathRequest():
            return await goals.set_path(agent_id, wire.parse(schema.Goals, request), expected)
        case goal_pb2.AppendGoalsRequest():
            return await goals.append(agent_id, wire.parse(schema.Goals, request), expected)
        case goal_pb2.WanderRequest():
            return await goals.wander(agent_id, wire.parse(schema.Wander, request), expected)
        case goal_pb2.BehaveRequest():
            wish = wire.parse(schema.Behaviour, request.behaviour, "behaviour")
            return await goals.behave(agent_id, wish, expected)
        case goal_pb2.ClearGoalRequest():
            return await goals.clear(agent_id, expected)
