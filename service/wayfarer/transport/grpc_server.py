"""gRPC: the services of `proto/wayfarer/v1`, health and reflection, over a Gateway."""

from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import aclosing
from typing import Any, Final

import grpc
import structlog
from grpc_health.v1 import health, health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection

from wayfarer.transport import convert, errors, schema
from wayfarer.transport.gateway import Gateway
from wayfarer.v1 import (
    agent_pb2,
    agent_pb2_grpc,
    catalog_pb2,
    catalog_pb2_grpc,
    goal_pb2,
    goal_pb2_grpc,
    motion_pb2,
    motion_pb2_grpc,
    session_pb2,
    session_pb2_grpc,
)

log = structlog.get_logger(__name__)

SERVICES: Final = tuple(
    service.full_name
    for file in (session_pb2, agent_pb2, goal_pb2, motion_pb2, catalog_pb2)
    for service in file.DESCRIPTOR.services_by_name.values()
)
Context = grpc.aio.ServicerContext


class SessionService(session_pb2_grpc.SessionServiceServicer):
    """Sessions."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway

    async def CreateSession(  # noqa: N802
        self, request: session_pb2.CreateSessionRequest, context: Context
    ) -> session_pb2.CreateSessionResponse:
        """See session.proto."""
        session = await self._gateway.create_session(convert.parse(schema.NewSession, request))
        return session_pb2.CreateSessionResponse(
            session=convert.message(session_pb2.Session, session)
        )

    async def GetSession(  # noqa: N802
        self, request: session_pb2.GetSessionRequest, context: Context
    ) -> session_pb2.GetSessionResponse:
        """See session.proto."""
        session = await self._gateway.get_session(request.session_id)
        return session_pb2.GetSessionResponse(session=convert.message(session_pb2.Session, session))

    async def DeleteSession(  # noqa: N802
        self, request: session_pb2.DeleteSessionRequest, context: Context
    ) -> session_pb2.DeleteSessionResponse:
        """See session.proto."""
        await self._gateway.delete_session(request.session_id)
        return session_pb2.DeleteSessionResponse()


class AgentService(agent_pb2_grpc.AgentServiceServicer):
    """Agents."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway

    async def CreateAgents(  # noqa: N802
        self, request: agent_pb2.CreateAgentsRequest, context: Context
    ) -> agent_pb2.CreateAgentsResponse:
        """See agent.proto."""
        specs = [
            convert.parse(schema.AgentSpec, spec, f"agents[{i}]")
            for i, spec in enumerate(request.agents)
        ]
        agents = await self._gateway.create_agents(request.session_id, specs)
        return agent_pb2.CreateAgentsResponse(agents=[_agent(agent) for agent in agents])

    async def GetAgent(  # noqa: N802
        self, request: agent_pb2.GetAgentRequest, context: Context
    ) -> agent_pb2.GetAgentResponse:
        """See agent.proto."""
        return agent_pb2.GetAgentResponse(
            agent=_agent(await self._gateway.get_agent(request.agent_id))
        )

    async def ListAgents(  # noqa: N802
        self, request: agent_pb2.ListAgentsRequest, context: Context
    ) -> agent_pb2.ListAgentsResponse:
        """See agent.proto."""
        agents = await self._gateway.list_agents(request.session_id)
        return agent_pb2.ListAgentsResponse(agents=[_agent(agent) for agent in agents])

    async def DeleteAgent(  # noqa: N802
        self, request: agent_pb2.DeleteAgentRequest, context: Context
    ) -> agent_pb2.DeleteAgentResponse:
        """See agent.proto."""
        await self._gateway.delete_agent(request.agent_id)
        return agent_pb2.DeleteAgentResponse()


class GoalService(goal_pb2_grpc.GoalServiceServicer):
    """Goals."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway

    async def SetGoal(  # noqa: N802
        self, request: goal_pb2.SetGoalRequest, context: Context
    ) -> goal_pb2.SetGoalResponse:
        """See goal.proto."""
        goal = convert.parse(schema.Goal, request.goal, "goal")
        revision = await self._gateway.set_goal(request.agent_id, goal)
        return goal_pb2.SetGoalResponse(revision=revision)

    async def SetPath(  # noqa: N802
        self, request: goal_pb2.SetPathRequest, context: Context
    ) -> goal_pb2.SetPathResponse:
        """See goal.proto."""
        goals = [
            convert.parse(schema.Goal, goal, f"goals[{i}]") for i, goal in enumerate(request.goals)
        ]
        revision = await self._gateway.set_path(request.agent_id, goals)
        return goal_pb2.SetPathResponse(revision=revision)

    async def ClearGoal(  # noqa: N802
        self, request: goal_pb2.ClearGoalRequest, context: Context
    ) -> goal_pb2.ClearGoalResponse:
        """See goal.proto."""
        revision = await self._gateway.clear_goal(request.agent_id)
        return goal_pb2.ClearGoalResponse(revision=revision)


class MotionService(motion_pb2_grpc.MotionServiceServicer):
    """Streams."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway

    async def StreamMotion(  # noqa: N802
        self, request: motion_pb2.StreamMotionRequest, context: Context
    ) -> AsyncGenerator[motion_pb2.StreamMotionResponse]:
        """See motion.proto. A cancelled call closes the generator, and so the subscription."""
        stream = self._gateway.stream(request.session_id, request.agent_ids)
        async with aclosing(stream) as messages:
            async for message in messages:
                yield message


class CatalogService(catalog_pb2_grpc.CatalogServiceServicer):
    """The catalogue."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway

    async def GetSkeleton(  # noqa: N802
        self, request: catalog_pb2.GetSkeletonRequest, context: Context
    ) -> catalog_pb2.GetSkeletonResponse:
        """See catalog.proto."""
        skeleton = convert.message(catalog_pb2.Skeleton, self._gateway.skeleton)
        return catalog_pb2.GetSkeletonResponse(skeleton=skeleton)

    async def ListBodies(  # noqa: N802
        self, request: catalog_pb2.ListBodiesRequest, context: Context
    ) -> catalog_pb2.ListBodiesResponse:
        """See catalog.proto."""
        bodies = self._gateway.list_bodies()
        return catalog_pb2.ListBodiesResponse(
            bodies=[convert.message(catalog_pb2.Body, body) for body in bodies]
        )

    async def ListModels(  # noqa: N802
        self, request: catalog_pb2.ListModelsRequest, context: Context
    ) -> catalog_pb2.ListModelsResponse:
        """See catalog.proto."""
        models = self._gateway.list_models()
        return catalog_pb2.ListModelsResponse(
            models=[convert.message(catalog_pb2.Model, model) for model in models]
        )

    async def GetServerInfo(  # noqa: N802
        self, request: catalog_pb2.GetServerInfoRequest, context: Context
    ) -> catalog_pb2.GetServerInfoResponse:
        """See catalog.proto."""
        return convert.message(catalog_pb2.GetServerInfoResponse, self._gateway.server_info())


class ErrorInterceptor(grpc.aio.ServerInterceptor):
    """Ends a call that raised with the status of errors.py; logs what was not expected.

    Only handlers of this project are wrapped. CancelledError and AbortError pass through.
    """

    async def intercept_service(
        self,
        continuation: Callable[[grpc.HandlerCallDetails], Awaitable[Any]],
        handler_call_details: grpc.HandlerCallDetails,
    ) -> Any:
        """Wrap the handler."""
        handler = await continuation(handler_call_details)
        method = handler_call_details.method
        if handler is None or not method.startswith("/wayfarer."):
            return handler
        if handler.unary_stream is not None:
            inner_stream: Any = handler.unary_stream

            async def stream(request: Any, context: Any) -> AsyncGenerator[Any]:
                try:
                    async with aclosing(inner_stream(request, context)) as messages:
                        async for message in messages:
                            yield message
                except grpc.aio.AbortError:
                    raise
                except Exception as error:
                    await _abort(context, method, error)

            return grpc.unary_stream_rpc_method_handler(
                stream, handler.request_deserializer, handler.response_serializer
            )
        inner: Any = handler.unary_unary

        async def unary(request: Any, context: Any) -> Any:
            try:
                return await inner(request, context)
            except grpc.aio.AbortError:
                raise
            except Exception as error:
                await _abort(context, method, error)

        return grpc.unary_unary_rpc_method_handler(
            unary, handler.request_deserializer, handler.response_serializer
        )


async def _abort(context: Any, method: str, error: Exception) -> None:
    errors.log_unexpected(log, error, method)
    await context.abort_with_status(errors.to_grpc(error))


def _agent(agent: schema.Agent) -> agent_pb2.Agent:
    return convert.message(agent_pb2.Agent, agent)


class GrpcServer:
    """The server with its health service. Create it inside a running event loop."""

    def __init__(self, gateway: Gateway, host: str, port: int) -> None:
        """Bind. Raises RuntimeError when that fails."""
        size = gateway.limits.message_bytes
        self._server = grpc.aio.server(
            interceptors=[ErrorInterceptor()],
            options=[
                ("grpc.so_reuseport", 0),  # else two servers would share a port in silence
                ("grpc.max_receive_message_length", size),
                ("grpc.max_metadata_size", 16 * 1024),
                # find clients that vanished without a word
                ("grpc.keepalive_time_ms", 20_000),
                ("grpc.keepalive_timeout_ms", 10_000),
                ("grpc.http2.min_recv_ping_interval_without_data_ms", 10_000),
                ("grpc.keepalive_permit_without_calls", 1),
            ],
        )
        session_pb2_grpc.add_SessionServiceServicer_to_server(SessionService(gateway), self._server)
        agent_pb2_grpc.add_AgentServiceServicer_to_server(AgentService(gateway), self._server)
        goal_pb2_grpc.add_GoalServiceServicer_to_server(GoalService(gateway), self._server)
        motion_pb2_grpc.add_MotionServiceServicer_to_server(MotionService(gateway), self._server)
        catalog_pb2_grpc.add_CatalogServiceServicer_to_server(CatalogService(gateway), self._server)
        self._health = health.aio.HealthServicer()  # type: ignore[attr-defined]
        health_pb2_grpc.add_HealthServicer_to_server(self._health, self._server)
        names = (*SERVICES, health.SERVICE_NAME, reflection.SERVICE_NAME)
        reflection.enable_server_reflection(names, self._server)
        self.port = self._server.add_insecure_port(f"{bracketed(host)}:{port}")

    async def start(self) -> None:
        """Take calls; health is NOT_SERVING until told otherwise."""
        await self.set_serving(False)
        await self._server.start()

    async def set_serving(self, serving: bool) -> None:
        """What grpc.health.v1 reports, of the server and of each service."""
        status = health_pb2.HealthCheckResponse
        for name in ("", *SERVICES):
            await self._health.set(name, status.SERVING if serving else status.NOT_SERVING)

    async def enter_shutdown(self) -> None:
        """Report NOT_SERVING for good."""
        await self._health.enter_graceful_shutdown()

    async def stop(self, grace: float) -> None:
        """Let calls end within `grace` seconds, stop."""
        await self._server.stop(grace)


def bracketed(host: str) -> str:
    """An IPv6 address as it stands in a URL."""
    return f"[{host}]" if ":" in host else host
