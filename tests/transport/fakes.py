"""An in-memory MotionService whose motion is made by hand, and a gateway over it."""

import asyncio
from collections.abc import Sequence
from itertools import count

import numpy as np

from wayfarer.config import Limits
from wayfarer.errors import NotFound, Unavailable, WayfarerError
from wayfarer.runtime.agent import (
    AgentInfo,
    AgentSpec,
    AgentState,
    ChunkFlag,
    Goal,
    LoopStats,
    MotionChunk,
    SessionInfo,
)
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS
from wayfarer.transport import schema
from wayfarer.transport.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway

NOW = 1_700_000_000.0


class FakeSubscription:
    def __init__(self, session_id: str, agent_ids: Sequence[str]) -> None:
        self.session_id = session_id
        self.agent_ids = set(agent_ids)
        self.queue: asyncio.Queue[list[MotionChunk] | WayfarerError | None] = asyncio.Queue()
        self.closed = False

    def __aiter__(self):
        return self

    async def __anext__(self) -> list[MotionChunk]:
        item = await self.queue.get()
        if item is None:
            raise StopAsyncIteration
        if isinstance(item, WayfarerError):
            raise item
        return item

    async def close(self) -> None:
        self.closed = True


class FakeService:
    """Agents stand where they were put; `emit` sends a chunk of each."""

    def __init__(self) -> None:
        self.ready = True
        self.alive = True
        self.specs: list[AgentSpec] = []
        self.goals: list[tuple[str, Goal | None]] = []
        self.subscriptions: list[FakeSubscription] = []
        self.fail_with: Exception | None = None  # the next command fails with it
        self._sessions: dict[str, list[AgentInfo]] = {}
        self._seq: dict[str, int] = {}
        self._number = count(1)

    def _session(self, session_id: str) -> list[AgentInfo]:
        if self.fail_with is not None:
            error, self.fail_with = self.fail_with, None
            raise error
        if session_id not in self._sessions:
            raise NotFound(f"no session {session_id!r}")
        return self._sessions[session_id]

    def _agent(self, agent_id: str) -> AgentInfo:
        for agents in self._sessions.values():
            for agent in agents:
                if agent.agent_id == agent_id:
                    return agent
        raise NotFound(f"no agent {agent_id!r}")

    async def create_session(self, session_id: str | None = None) -> SessionInfo:
        session_id = session_id or f"session-{next(self._number)}"
        self._sessions[session_id] = []
        return await self.get_session(session_id)

    async def get_session(self, session_id: str) -> SessionInfo:
        agents = self._session(session_id)
        return SessionInfo(session_id, tuple(a.agent_id for a in agents), NOW)

    async def delete_session(self, session_id: str) -> None:
        self._session(session_id)
        del self._sessions[session_id]
        for subscription in self.subscriptions:
            if subscription.session_id == session_id:
                subscription.queue.put_nowait(None)

    async def create_agents(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentInfo]:
        agents = self._session(session_id)
        self.specs += specs
        made = [
            AgentInfo(
                agent_id=f"agent-{next(self._number)}",
                alias=len(agents) + i + 1,
                session_id=session_id,
                spec=spec,
                state=AgentState.STANDING,
                position=(*spec.position, 0.9),
                heading=spec.heading,
                goal=None,
                goal_revision=0,
                created_at=NOW,
            )
            for i, spec in enumerate(specs)
        ]
        agents += made
        return made

    async def get_agent(self, agent_id: str) -> AgentInfo:
        return self._agent(agent_id)

    async def list_agents(self, session_id: str) -> list[AgentInfo]:
        return list(self._session(session_id))

    async def delete_agent(self, agent_id: str) -> None:
        agent = self._agent(agent_id)
        self._sessions[agent.session_id].remove(agent)

    async def set_goal(self, agent_id: str, goal: Goal) -> int:
        self._agent(agent_id)
        self.goals.append((agent_id, goal))
        return len(self.goals)

    async def set_path(self, agent_id: str, goals: Sequence[Goal]) -> int:
        self._agent(agent_id)
        self.goals += [(agent_id, goal) for goal in goals]
        return len(self.goals)

    async def clear_goal(self, agent_id: str) -> int:
        self._agent(agent_id)
        self.goals.append((agent_id, None))
        return len(self.goals)

    async def subscribe(self, session_id: str, agent_ids: Sequence[str] = ()) -> FakeSubscription:
        known = {agent.agent_id for agent in self._session(session_id)}
        if unknown := set(agent_ids) - known:
            raise NotFound(f"no agents {sorted(unknown)}")
        subscription = FakeSubscription(session_id, agent_ids)
        self.subscriptions.append(subscription)
        return subscription

    async def stats(self) -> LoopStats:
        return LoopStats(1, 1, 1, 10, 2.5, 3.0, 0, 0.1, 12.0)

    def emit(self, session_id: str) -> list[MotionChunk]:
        """One chunk of each agent of a session, to every subscription of it."""
        chunks = []
        for agent in self._sessions[session_id]:
            seq = self._seq.get(agent.agent_id, 0)
            self._seq[agent.agent_id] = seq + 1
            chunks.append(chunk(agent.agent_id, agent.alias, seq, agent.position))
        for subscription in self.subscriptions:
            wanted = [
                c
                for c in chunks
                if not subscription.agent_ids or c.agent_id in subscription.agent_ids
            ]
            if subscription.session_id == session_id and wanted and not subscription.closed:
                subscription.queue.put_nowait(wanted)
        return chunks

    def break_down(self) -> None:
        """As when the motion loop ends with an error."""
        self.ready = self.alive = False
        for subscription in self.subscriptions:
            subscription.queue.put_nowait(Unavailable("the motion loop has failed"))


def chunk(
    agent_id: str = "agent-1",
    alias: int = 1,
    seq: int = 0,
    hips: tuple[float, float, float] = (1.0, 2.0, 0.9),
) -> MotionChunk:
    """Frames in which the hips move along +Y and turn about +Z, 0.1 per frame."""
    step = np.arange(NEW_FRAMES) * 0.1
    translation = np.array(hips, np.float32) + np.outer(step, [0, 1, 0]).astype(np.float32)
    rotations = np.zeros((NEW_FRAMES, POSED_JOINTS, 4), np.float32)
    rotations[..., 3] = 1.0
    rotations[:, 0, 2], rotations[:, 0, 3] = np.sin(step / 2), np.cos(step / 2)
    contacts = np.zeros((NEW_FRAMES, 2), bool)
    contacts[::2, 0] = contacts[1::2, 1] = True
    return MotionChunk(
        agent_id=agent_id,
        alias=alias,
        seq=seq,
        first_frame=seq * NEW_FRAMES,
        scheduled_at=NOW + seq * 0.2,
        goal_revision=0,
        flags=ChunkFlag.FIRST if seq == 0 else ChunkFlag.NONE,
        state=AgentState.STANDING,
        translation=translation.astype(np.float32),
        rotations=rotations,
        contacts=contacts,
        waypoint=5,
        candidates=4,
    )


class Clock:
    """Turned by hand."""

    def __init__(self) -> None:
        self.now = NOW

    def __call__(self) -> float:
        return self.now


MODEL = schema.Model(
    name="fake", genders=("female", "male"), seed_frames=2, primitive_frames=10, sha256=("0", "1")
)


def gateway(
    service: FakeService | None = None, limits: Limits | None = None, clock: Clock | None = None
) -> Gateway:
    return Gateway(
        service or FakeService(),
        BodyLibrary("anny52"),
        [MODEL],
        limits or Limits(),
        clock or Clock(),
    )
