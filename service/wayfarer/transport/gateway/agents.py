"""Agents."""

import asyncio
from collections.abc import Sequence
from typing import Final

from wayfarer.errors import InvalidArgument
from wayfarer.transport import convert, schema
from wayfarer.transport.caller import Scope, current_caller
from wayfarer.transport.gateway.context import GatewayContext, needs
from wayfarer.transport.gateway.session_registry import OpenSession
from wayfarer.world.agents.agent import AgentInfo

AT_ONCE: Final = 4
"""Agents that are described without letting others go ahead."""


class AgentApi:
    """AgentService."""

    def __init__(self, shared: GatewayContext) -> None:
        self._shared = shared

    @needs(Scope.CONTROL)
    async def create(self, session_id: str, wish: schema.NewAgents) -> schema.Agents:
        """Create agents, all or none. Raises NotFound, InvalidArgument, ResourceExhausted, …"""
        self._shared.require_ready()
        self._shared.book.session(session_id)
        return await self._shared.replies.once(
            wish.request_id, (session_id, wish), lambda: self._create(session_id, wish)
        )

    async def _create(self, session_id: str, wish: schema.NewAgents) -> schema.Agents:
        session = self._shared.book.session(session_id)
        most, asked = self._shared.limits.agents_per_call, len(wish.agents)
        if asked > most:
            raise InvalidArgument(f"1 to {most} agents per call, not {asked}", "agents")
        self._shared.book.require_room(current_caller(), asked)
        first = session.created
        session.created += asked  # before the first await: two calls at a time draw other seeds
        try:
            specs = [
                convert.agent_spec(
                    spec,
                    session.basis,
                    self._shared.bodies,
                    convert.drawn_seed(session.info.spec.seed, first + i),
                )
                for i, spec in enumerate(wish.agents)
            ]
            with convert.in_basis(session.basis.axes):
                made = await self._shared.service.create_agents(session_id, specs)
        except BaseException:
            if session.created == first + asked:
                session.created = first
            raise
        self._shared.book.enter_agents(session, made)
        return await self._described(session, made)

    @needs(Scope.READ)
    async def get(self, agent_id: str) -> schema.Agent:
        """Describe one agent. Raises NotFound."""
        session = await self._shared.session_of(agent_id)
        info = await self._shared.service.get_agent(agent_id)
        return convert.agent(info, session.basis, self._shared.bodies)

    @needs(Scope.READ)
    async def list_of(self, session_id: str) -> schema.Agents:
        """Describe all agents of a session. Raises NotFound."""
        session = self._shared.book.session(session_id)
        infos = await self._shared.service.list_agents(session_id)
        return await self._described(session, infos)

    @needs(Scope.CONTROL)
    async def update(self, agent_id: str, wish: schema.AgentUpdate) -> schema.Agent:
        """Change its name, its foot lock. Raises NotFound, InvalidArgument."""
        session = await self._shared.session_of(agent_id)
        info = await self._shared.service.update_agent(agent_id, convert.agent_change(wish))
        return convert.agent(info, session.basis, self._shared.bodies)

    @needs(Scope.CONTROL)
    async def delete(self, agent_id: str) -> None:
        """Remove an agent; the session's streams report it. Raises NotFound."""
        session = await self._shared.session_of(agent_id)
        await self._shared.service.delete_agent(agent_id)
        self._shared.book.remove_agent(session, agent_id)

    async def _described(self, session: OpenSession, infos: Sequence[AgentInfo]) -> schema.Agents:
        """A few at a time: each takes half a millisecond, in which other calls wait."""
        described: list[schema.Agent] = []
        for info in infos:
            if len(described) % AT_ONCE == 0:
                await asyncio.sleep(0)
            described.append(convert.agent(info, session.basis, self._shared.bodies))
        return schema.Agents(agents=tuple(described))
