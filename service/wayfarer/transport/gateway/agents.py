"""Agents."""

import asyncio
from collections.abc import Sequence
from typing import Final

from wayfarer.errors import InvalidArgument
from wayfarer.ids import agent_ids
from wayfarer.transport import schema
from wayfarer.transport.conversion import convert
from wayfarer.transport.edge.caller import current_caller
from wayfarer.transport.gateway.context import GatewayContext, implements
from wayfarer.transport.gateway.idempotency import finish
from wayfarer.transport.gateway.session_registry import OpenSession
from wayfarer.world.agents.agent import AgentChange, AgentInfo

YIELD_EVERY: Final = 4
"""Number of agents that are described before other calls get a turn."""


class AgentApi:
    """AgentService."""

    def __init__(self, context: GatewayContext) -> None:
        self._context = context

    @implements("CreateAgents")
    async def create(self, session_id: str, request: schema.NewAgents) -> schema.Agents:
        """Creates all or none. Raises NotFound, InvalidArgument, ResourceExhausted, Aborted."""
        self._context.require_ready()
        self._context.sessions.session(session_id)
        return await self._context.replies.once(
            request.request_id,
            (session_id, request),
            lambda digest: self._create(session_id, request, digest),
        )

    async def _create(
        self, session_id: str, request: schema.NewAgents, digest: str
    ) -> schema.Agents:
        session = self._context.sessions.session(session_id)
        most, count = self._context.limits.agents_per_call, len(request.agents)
        if count > most:
            raise InvalidArgument(f"1 to {most} agents per call, not {count}", "agents")
        names = list[str]()
        if digest:
            names = agent_ids(session_id, digest, count)
            if known := [name for name in names if name in session.aliases]:
                # made before, and the reply is lost: with the node's life, or by a restart
                get = self._context.service.get_agent
                return await self._described(session, [await get(name) for name in known])
        with self._context.sessions.agent_room(current_caller(), count):
            made = await self._made(session, request, names)
            self._context.sessions.enter_agents(session, made)
        await self._context.locator.copied(session_id)
        return await self._described(session, made)

    async def _made(
        self, session: OpenSession, request: schema.NewAgents, names: Sequence[str]
    ) -> list[AgentInfo]:
        first, count = session.drawn, len(request.agents)
        session.drawn += count  # before the first await: concurrent calls draw other seeds
        try:
            specs = [
                convert.agent_spec(
                    spec,
                    session.basis,
                    self._context.bodies,
                    convert.drawn_seed(session.info.spec.seed, first + i),
                )
                for i, spec in enumerate(request.agents)
            ]
            with convert.in_basis(session.basis.axes):
                return await self._context.service.create_agents(session.session_id, specs, names)
        except BaseException:
            if session.drawn == first + count:
                session.drawn = first
            raise

    @implements("GetAgent")
    async def get(self, agent_id: str) -> schema.Agent:
        """Describes one agent. Raises NotFound."""
        session = await self._context.session_of(agent_id)
        info = await self._context.service.get_agent(agent_id)
        return convert.agent(info, session.basis, self._context.bodies)

    @implements("ListAgents")
    async def list_of(self, session_id: str) -> schema.Agents:
        """Describes all agents of a session. Raises NotFound."""
        session = self._context.sessions.session(session_id)
        infos = await self._context.service.list_agents(session_id)
        return await self._described(session, infos)

    @implements("UpdateAgent")
    async def update(self, agent_id: str, request: schema.AgentUpdate) -> schema.Agent:
        """Changes its name or its foot lock. Raises NotFound, InvalidArgument."""
        session = await self._context.session_of(agent_id)
        change = AgentChange(**request.model_dump())
        info = await self._context.service.update_agent(agent_id, change)
        await self._context.locator.copied(session.session_id)
        return convert.agent(info, session.basis, self._context.bodies)

    @implements("DeleteAgent")
    async def delete(self, agent_id: str) -> None:
        """Removes an agent; the session's streams report it. Raises NotFound."""
        await finish(self._delete(await self._context.session_of(agent_id), agent_id))

    async def _delete(self, session: OpenSession, agent_id: str) -> None:
        alias = session.aliases.get(agent_id)
        if alias is None:  # a person of a crowd
            alias = (await self._context.service.get_agent(agent_id)).alias
        await self._context.service.delete_agent(agent_id)
        self._context.sessions.remove_agent(session, agent_id, alias)
        await self._context.locator.copied(session.session_id)

    async def _described(self, session: OpenSession, infos: Sequence[AgentInfo]) -> schema.Agents:
        """Describes a few at a time: each takes half a millisecond in which other calls wait."""
        described: list[schema.Agent] = []
        for info in infos:
            if len(described) % YIELD_EVERY == 0:
                await asyncio.sleep(0)
            described.append(convert.agent(info, session.basis, self._context.bodies))
        return schema.Agents(agents=tuple(described))
