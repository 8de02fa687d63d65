"""A world that loses nothing: what changes goes to the journal, and what is told to a log."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.runtime.agent import (
    AgentChange,
    AgentInfo,
    AgentSpec,
    SessionInfo,
    SessionSpec,
)
from wayfarer.runtime.commands import GoalCommand
from wayfarer.runtime.engines.engine import Engine
from wayfarer.runtime.engines.models import Models
from wayfarer.runtime.scenes.book import Book
from wayfarer.runtime.settings import WorldSettings
from wayfarer.runtime.state.journal import Journal
from wayfarer.runtime.state.journal_entries import Crowd, Member
from wayfarer.runtime.state.record import CommandLog, CommandLogs
from wayfarer.runtime.state.snapshot import AgentPart, SessionPart, Standing
from wayfarer.runtime.world.handover import AgentRecord, SessionRecord
from wayfarer.runtime.world.registry import Agent, Session
from wayfarer.runtime.world.reservations import Reservation
from wayfarer.runtime.world.slots import Mode, Motion
from wayfarer.runtime.world.views import Due
from wayfarer.runtime.world.world import World


class KeptWorld(World):
    """`World`, kept by a journal if there is one, and recorded where sessions ask for it."""

    def __init__(
        self,
        engine: Engine | Models,
        bodies: Mapping[str, BodyModel],
        start_poses: NDArray[np.float32],
        settings: WorldSettings | None = None,
        journal: Journal | None = None,
        log_entries: int = 100_000,
        scenes: Book | None = None,
    ) -> None:
        """As `World`; a log has up to `log_entries`."""
        self._logs = CommandLogs(log_entries, self.get_agent)
        super().__init__(engine, bodies, start_poses, settings, self._logs, scenes)
        self._journal = journal
        self._saved = 0
        self._orders_at: dict[str, int] = {}  # first chunk that an agent's last order counts for

    def log(self, session_id: str) -> CommandLog:
        """A copy of what a recorded session was told. Raises NotFound, FailedPrecondition."""
        self.get_session(session_id)
        return self._logs.copy(session_id)

    def capture(self, session_id: str) -> tuple[SessionPart, Crowd]:
        """A session and its agents as of the last chunks sent, copied. Raises NotFound."""
        session = self._registry.session(session_id)
        return _session_part(session), self._crowd(list(session.agents.values()))

    def save(self, parts: int = 1) -> None:
        """Let the journal know where agents stand now: one in so many, in turn."""
        if self._journal is None or not self._registry.agents:
            return
        self._saved = (self._saved + 1) % parts
        agents = list(self._registry.agents.values())[self._saved :: parts]
        if agents:
            self._journal.refresh(self._crowd(agents))

    def send(self, until: float) -> list[Due]:
        """See `World`, as for all below."""
        found = super().send(until)
        for due in found:
            self._logs.sent(due)
        return found

    def create_session(self, spec: SessionSpec, now: float) -> SessionInfo:
        """See `World`."""
        session = super().create_session(spec, now)
        self._logs.open(session.session_id, spec, now)
        self._keep(session.session_id)
        return session

    def put_session(
        self, record: SessionRecord, now: float, admit: bool = True, examined: bool = False
    ) -> SessionInfo:
        """See `World`. A log begins with the agents as they are."""
        self._logs.open(record.session_id, record.spec, record.created_at)
        try:
            session = super().put_session(record, now, admit, examined)
        except Exception:
            self._logs.close(record.session_id)
            raise
        self._keep(record.session_id, session.agent_ids)
        return session

    def delete_session(self, session_id: str) -> None:
        """See `World`."""
        agents = self.get_session(session_id).agent_ids
        super().delete_session(session_id)
        self._logs.close(session_id)
        if self._journal is not None:
            self._journal.drop_session(session_id, agents)

    def create_agents(
        self,
        session_id: str,
        specs: Sequence[AgentSpec],
        now: float,
        seeds: Sequence[Motion] | None = None,
        reservation: Reservation | None = None,
    ) -> list[AgentInfo]:
        """See `World`."""
        agents = super().create_agents(session_id, specs, now, seeds, reservation)
        self._keep(session_id, [agent.agent_id for agent in agents])
        return agents

    def put_agent(self, session_id: str, record: AgentRecord, now: float) -> AgentInfo:
        """See `World`."""
        agent = super().put_agent(session_id, record, now)
        self._keep(session_id, [agent.agent_id])
        return agent

    def update_agent(self, agent_id: str, change: AgentChange) -> AgentInfo:
        """See `World`."""
        agent = super().update_agent(agent_id, change)
        self._keep(agent.session_id, [agent_id])
        return agent

    def delete_agent(self, agent_id: str) -> None:
        """See `World`."""
        super().delete_agent(agent_id)
        self._orders_at.pop(agent_id, None)
        if self._journal is not None:
            self._journal.drop_agents([agent_id])

    def give(
        self, agent_id: str, command: GoalCommand, now: float, expected: int | None = None
    ) -> int:
        """See `World`."""
        revision = super().give(agent_id, command, now, expected)
        agent = self._registry.agent(agent_id)
        self._orders_at[agent_id] = int(self._table.rows.planned_chunks[agent.slot])
        self._keep(agent.session_id, [agent_id])
        return revision

    def is_settled(self, session_id: str) -> bool:
        """No chunk waits to be sent that was planned before its agent's last order.

        Then the session can be taken out so that it goes on bit for bit. Raises NotFound.
        """
        sent = self._table.rows.sent_chunks
        agents = self._registry.session(session_id).agents.values()
        return all(sent[a.slot] >= self._orders_at.get(a.agent_id, 0) for a in agents)

    def _keep(self, session_id: str, agent_ids: Sequence[str] = ()) -> None:
        """Let the journal have a session, whose last alias may be another now, and agents of it."""
        if self._journal is None:
            return
        session = self._registry.session(session_id)
        self._journal.put_session(_session_part(session))
        agents = [self._registry.agent(agent_id) for agent_id in agent_ids]
        if agents:
            self._journal.refresh(self._crowd(agents))

    def _crowd(self, agents: Sequence[Agent]) -> Crowd:
        """Agents as of the last chunks sent, on their present paths; see `Orders.at_rest`."""
        slots, rows = self._table.rows, np.array([agent.slot for agent in agents], np.int64)
        seq, motion = slots.sent_chunks[rows], slots.committed.take(rows)
        gait, has_path = motion.gait, np.array([bool(agent.path) for agent in agents], np.bool_)
        sets_out = seq <= slots.revised_chunk[rows]
        gait.mode[sets_out & has_path] = Mode.WALKING
        gait.arrived[sets_out] = False
        gait.waypoint[sets_out] = 0
        revisions = slots.goal_revision[rows].tolist()
        models = [self.models.numbered(number).stamp for number in slots.model[rows].tolist()]
        return Crowd(
            [_member(*known) for known in zip(agents, revisions, models, strict=True)],
            Standing(
                seq,
                motion,
                slots.feet.take(rows),
                slots.feet_begun[rows],
                slots.footing.take(rows),
            ),
        )


def kept(world: World) -> KeptWorld:
    """The world of a home, which is always one of these."""
    assert isinstance(world, KeptWorld)
    return world


def _session_part(session: Session) -> SessionPart:
    spec = replace(session.spec, session_id=session.session_id)
    return SessionPart(session.session_id, spec, session.created_at, session.last_alias)


def _member(agent: Agent, revision: int, model: str) -> Member:
    return Member(
        agent.session_id,
        AgentPart(
            agent_id=agent.agent_id,
            alias=agent.alias,
            spec=agent.spec,
            created_at=agent.created_at,
            goal_revision=revision,
            path=agent.path,
            passed=agent.passed,
            path_start=agent.path_start,
            behaviour=agent.behaviour,
            part=agent.part,
            begun=agent.begun,
            model=model,
        ),
    )
