"""A world's sessions and agents as of the last chunks sent, for the journal and for snapshots."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wayfarer.runtime.persistence.journal import Journal
from wayfarer.runtime.persistence.journal_entries import (
    CapturedAgents,
    Member,
    agents_in,
    no_agents,
)
from wayfarer.runtime.persistence.journal_file import EntryKind
from wayfarer.runtime.persistence.session_record import CapturedSession
from wayfarer.runtime.persistence.snapshot import AgentPart, AgentRows, SessionPart
from wayfarer.world.agents.agent import AgentChange
from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.registry import Session
from wayfarer.world.agents.slots import Mode
from wayfarer.world.behaviours import known_behaviour
from wayfarer.world.goals.commands import GoalCommand
from wayfarer.world.observer import Start, WorldObserver
from wayfarer.world.world import World


def capture_session(world: World, session_id: str) -> CapturedSession:
    """A session and its agents. Raises NotFound."""
    session = world.registry.session(session_id)
    agents = capture_agents(world, list(session.agents.values()))
    return CapturedSession(_session_part(session), agents)


def capture_agents(world: World, agents: Sequence[Agent]) -> CapturedAgents:
    """Agents on their present paths, also where nothing planned for these has been sent."""
    slots, rows = world.slots, np.array([agent.slot for agent in agents], np.int64)
    seq, motion = slots.sent_chunks[rows], slots.committed.take(rows)
    gait, has_path = motion.gait, np.array([bool(agent.path) for agent in agents], np.bool_)
    sets_out = seq <= slots.revised_chunk[rows]
    gait.mode[sets_out & has_path] = Mode.WALKING
    gait.arrived[sets_out] = False
    gait.waypoint[sets_out] = 0
    revisions = slots.goal_revision[rows].tolist()
    models = [world.models.numbered(number).stamp for number in slots.model[rows].tolist()]
    return CapturedAgents(
        [_member(*known) for known in zip(agents, revisions, models, strict=True)],
        AgentRows.of(seq, motion, slots.footing.take(rows)),
    )


def capture_planned(world: World, session_id: str) -> CapturedSession:
    """A frozen session whose chunks are all sent, as its agents would continue. Raises NotFound."""
    taken, agents = capture_session(world, session_id), world.registry.session(session_id).agents
    rows = np.array([agent.slot for agent in agents.values()])
    motion = world.slots.planned.take(rows.astype(np.int64))
    sent = taken.agents.rows
    crowd = replace(taken.agents, rows=AgentRows.of(sent.seq, motion, sent.footing))
    return taken._replace(
        agents=crowd, crowd=world.crowds.copy(session_id), rows=world.live_rows(session_id)
    )


class JournalObserver(WorldObserver):
    """Puts what changes in a world into the journal.

    Planned chunks that are not sent are made again after a restart.
    """

    def __init__(self, journal: Journal, world: World) -> None:
        self._journal = journal
        self._world = world

    def opened(self, session: Session) -> None:
        """Keeps the session."""
        self._journal.open_session(_session_part(session))

    def closed(self, session: Session) -> None:
        """Forgets the session."""
        self._journal.put({(EntryKind.SESSION, session.session_id): None})

    def created(self, session: Session, agents: Sequence[Agent], starts: Sequence[Start]) -> None:
        """Keeps the agents, and the session, whose last alias has changed."""
        self._journal.put({(EntryKind.SESSION, session.session_id): _session_part(session)})
        if agents:
            self.stood(agents)

    def commanded(self, agent: Agent, command: GoalCommand, seq: int) -> None:
        """Keeps the agent's path or behaviour."""
        self.stood([agent])

    def changed(self, agent: Agent, change: AgentChange, seq: int) -> None:
        """Keeps the agent's new spec."""
        self.stood([agent])

    def deleted(self, agent: Agent, seq: int) -> None:
        """Forgets the agent."""
        self._journal.put(no_agents([agent.agent_id]))

    def stood(self, agents: Sequence[Agent]) -> None:
        """Keeps where agents stand."""
        self._journal.put(agents_in(capture_agents(self._world, agents)))


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
            behaviour=None if agent.behaviour is None else known_behaviour(agent.behaviour),
            part=agent.part,
            begun=agent.begun,
            model=model,
        ),
    )
