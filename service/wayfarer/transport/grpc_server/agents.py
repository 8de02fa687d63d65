"""AgentService over the gateway."""

from grpc.aio import ServicerContext as Context

from wayfarer.transport import schema, wire
from wayfarer.transport.gateway import Gateway
from wayfarer.v1 import agent_pb2, agent_pb2_grpc


class AgentService(agent_pb2_grpc.AgentServiceServicer):
    """See agent.proto."""

    def __init__(self, gateway: Gateway) -> None:
        self._agents = gateway.agents

    async def CreateAgents(  # noqa: N802
        self, request: agent_pb2.CreateAgentsRequest, context: Context
    ) -> agent_pb2.CreateAgentsResponse:
        """Create agents, all or none."""
        wish = wire.parse(schema.NewAgents, request)
        agents = await self._agents.create(request.session_id, wish)
        return wire.message(agent_pb2.CreateAgentsResponse, agents)

    async def GetAgent(  # noqa: N802
        self, request: agent_pb2.GetAgentRequest, context: Context
    ) -> agent_pb2.GetAgentResponse:
        """Describe one agent."""
        agent = await self._agents.get(request.agent_id)
        return agent_pb2.GetAgentResponse(agent=wire.message(agent_pb2.Agent, agent))

    async def ListAgents(  # noqa: N802
        self, request: agent_pb2.ListAgentsRequest, context: Context
    ) -> agent_pb2.ListAgentsResponse:
        """Describe all agents of a session."""
        agents = await self._agents.list_of(request.session_id)
        return wire.message(agent_pb2.ListAgentsResponse, agents)

    async def UpdateAgent(  # noqa: N802
        self, request: agent_pb2.UpdateAgentRequest, context: Context
    ) -> agent_pb2.UpdateAgentResponse:
        """Change an agent."""
        wish = wire.parse(schema.AgentUpdate, request)
        agent = await self._agents.update(request.agent_id, wish)
        return agent_pb2.UpdateAgentResponse(agent=wire.message(agent_pb2.Agent, agent))

    async def DeleteAgent(  # noqa: N802
        self, request: agent_pb2.DeleteAgentRequest, context: Context
    ) -> agent_pb2.DeleteAgentResponse:
        """Remove an agent."""
        await self._agents.delete(request.agent_id)
        return agent_pb2.DeleteAgentResponse()
