"""The one door of the runtime: what every transport calls.

`MotionLoop` (loop.py) implements it. All methods may be awaited from the event loop; none
blocks it. Errors are those of `wayfarer.errors`.
"""

from collections.abc import AsyncIterator, Sequence
from typing import Protocol

from wayfarer.runtime.agent import AgentInfo, AgentSpec, Goal, LoopStats, MotionChunk, SessionInfo


class Subscription(Protocol):
    """A bounded queue of chunk batches; a slow reader loses the oldest (flag GAP)."""

    def __aiter__(self) -> AsyncIterator[Sequence[MotionChunk]]:
        """Yield batches (chunks that fell due together) until the session ends."""
        ...

    async def close(self) -> None:
        """Stop receiving. Safe to call twice."""
        ...


class MotionService(Protocol):
    """Sessions, agents, goals, streams."""

    @property
    def ready(self) -> bool:
        """Models are loaded and warm and the loop is running."""
        ...

    @property
    def alive(self) -> bool:
        """The loop has made a turn within the last second."""
        ...

    async def create_session(self, session_id: str | None = None) -> SessionInfo:
        """Open a session. Raises AlreadyExists, ResourceExhausted."""
        ...

    async def get_session(self, session_id: str) -> SessionInfo:
        """Raises NotFound."""
        ...

    async def delete_session(self, session_id: str) -> None:
        """End a session, its agents and its streams. Raises NotFound."""
        ...

    async def create_agents(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentInfo]:
        """All or none. Raises NotFound, InvalidArgument, ResourceExhausted."""
        ...

    async def get_agent(self, agent_id: str) -> AgentInfo:
        """Raises NotFound."""
        ...

    async def list_agents(self, session_id: str) -> list[AgentInfo]:
        """Raises NotFound."""
        ...

    async def delete_agent(self, agent_id: str) -> None:
        """Raises NotFound."""
        ...

    async def set_goal(self, agent_id: str, goal: Goal) -> int:
        """Return the new goal revision. Raises NotFound, InvalidArgument."""
        ...

    async def set_path(self, agent_id: str, goals: Sequence[Goal]) -> int:
        """Goals to visit in turn; one revision for all. Raises NotFound, InvalidArgument."""
        ...

    async def clear_goal(self, agent_id: str) -> int:
        """Stop where the agent is. Return the new revision. Raises NotFound."""
        ...

    async def subscribe(self, session_id: str, agent_ids: Sequence[str] = ()) -> Subscription:
        """Follow all agents of a session (later ones too), or those named. Raises NotFound."""
        ...

    async def stats(self) -> LoopStats:
        """Figures for dashboards and the viewer."""
        ...
