"""GoalService over the gateway."""

from collections.abc import Awaitable, Callable
from typing import Any

from google.protobuf.message_factory import GetMessageClass
from grpc.aio import ServicerContext as Context

from wayfarer.transport.gateway import Gateway
from wayfarer.transport.gateway.goals import GoalApi
from wayfarer.transport.goal_requests import GoalRequest, give
from wayfarer.v1 import goal_pb2, goal_pb2_grpc


def goal_service(gateway: Gateway) -> goal_pb2_grpc.GoalServiceServicer:
    """The servicer of goal.proto: every method gives a command and returns the new revision."""
    servicer = goal_pb2_grpc.GoalServiceServicer()
    for method in goal_pb2.DESCRIPTOR.services_by_name["GoalService"].methods:
        response = GetMessageClass(method.output_type)
        setattr(servicer, method.name, _method(gateway.goals, response))
    return servicer


def _method(
    goals: GoalApi, response: type[Any]
) -> Callable[[GoalRequest, Context], Awaitable[Any]]:
    async def call(request: GoalRequest, _: Context) -> Any:
        return response(revision=await give(request, goals))

    return call
