"""GoalService over the gateway."""

from grpc.aio import ServicerContext as Context

from wayfarer.transport.gateway import Gateway
from wayfarer.transport.goal_requests import carry_out
from wayfarer.v1 import goal_pb2, goal_pb2_grpc


class GoalService(goal_pb2_grpc.GoalServiceServicer):
    """See goal.proto."""

    def __init__(self, gateway: Gateway) -> None:
        self._goals = gateway.goals

    async def SetGoal(  # noqa: N802
        self, request: goal_pb2.SetGoalRequest, context: Context
    ) -> goal_pb2.SetGoalResponse:
        """A goal in place of the present one."""
        return goal_pb2.SetGoalResponse(revision=await carry_out(request, self._goals))

    async def SetPath(  # noqa: N802
        self, request: goal_pb2.SetPathRequest, context: Context
    ) -> goal_pb2.SetPathResponse:
        """Goals to visit in turn."""
        return goal_pb2.SetPathResponse(revision=await carry_out(request, self._goals))

    async def AppendGoals(  # noqa: N802
        self, request: goal_pb2.AppendGoalsRequest, context: Context
    ) -> goal_pb2.AppendGoalsResponse:
        """More goals at the end of the path."""
        return goal_pb2.AppendGoalsResponse(revision=await carry_out(request, self._goals))

    async def Wander(  # noqa: N802
        self, request: goal_pb2.WanderRequest, context: Context
    ) -> goal_pb2.WanderResponse:
        """Walk about in an area."""
        return goal_pb2.WanderResponse(revision=await carry_out(request, self._goals))

    async def Behave(  # noqa: N802
        self, request: goal_pb2.BehaveRequest, context: Context
    ) -> goal_pb2.BehaveResponse:
        """Do something of itself."""
        return goal_pb2.BehaveResponse(revision=await carry_out(request, self._goals))

    async def ClearGoal(  # noqa: N802
        self, request: goal_pb2.ClearGoalRequest, context: Context
    ) -> goal_pb2.ClearGoalResponse:
        """Stop."""
        return goal_pb2.ClearGoalResponse(revision=await carry_out(request, self._goals))
