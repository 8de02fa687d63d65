"""Sessions and agents enter a world and leave it: new ones, or records from any world."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wayfarer.config.limits import Limits
from wayfarer.errors import AlreadyExists, WayfarerError
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.faults import Faults
from wayfarer.world.agents.population import Population
from wayfarer.world.agents.records import AgentRecord, LiveRows, SessionRecord
from wayfarer.world.agents.registry import Registry, Session
from wayfarer.world.agents.reservations import Reservation
from wayfarer.world.agents.slots import Slots
from wayfarer.world.goal_commands import GoalCommands
from wayfarer.world.observer import Observers, Start
from wayfarer.world.record_checks import check_agent_record, check_session_record
from wayfarer.world.rows import Double, Index
from wayfarer.world.scenes.routes import Routes
from wayfarer.world.scenes.world_scenes import WorldScenes
from wayfarer.world.stepping.load import Load


@dataclass(eq=False, kw_only=True)
class Membership:
    """The sessions and agents of a world. `observers` receive every change."""

    registry: Registry
    slots: Slots
    population: Population
    goals: GoalCommands
    scenery: WorldScenes
    routes: Routes
    load: Load
    limits: Limits
    observers: Observers
    faults: Faults

    def open(self, spec: SessionSpec, created_at: float) -> Session:
        """Opens a session without agents.

        Raises AlreadyExists, ResourceExhausted, and FailedPrecondition if its scene is not on this
        server.
        """
        session = self._add(spec, created_at)
        self.observers.tell(lambda observer: observer.opened(session), session.session_id)
        return session

    def close(self, session: Session) -> None:
        """Ends a session and its agents."""
        for agent in tuple(session.agents.values()):
            self.remove(agent)
        self._remove(session)
        self.faults.forget_session(session.session_id)
        self.observers.tell(lambda observer: observer.closed(session), session.session_id)

    def settle(
        self,
        session: Session,
        agents: Sequence[Agent],
        starts: Sequence[Start],
    ) -> None:
        """Starts agents in their slots on their paths, and reports them."""
        try:
            for agent in agents:
                self.goals.restore(agent)
        except Exception:
            for agent in agents:
                self.population.remove(agent)
            raise
        self.observers.tell(lambda o: o.created(session, agents, starts), session.session_id)

    def remove(self, agent: Agent) -> None:
        """Removes an agent; its planned frames are discarded."""
        seq = int(self.slots.sent_chunks[agent.slot])
        self.observers.tell(lambda observer: observer.deleted(agent, seq), agent.session_id)
        self.population.remove(agent)
        self.faults.forget(agent.slot)

    # Records

    def examine(self, record: SessionRecord) -> None:
        """The costly part of `put_session`; thread-safe. Raises InvalidArgument."""
        check_session_record(record, self.limits)
        self.population.measure(agent.spec for agent in record.agents)

    def put_session(
        self,
        record: SessionRecord,
        now: float,
        admit: bool = True,
        examined: bool = False,
        live: LiveRows | None = None,
    ) -> Session:
        """Resumes a recorded session: the next chunk of each agent follows its last one.

        All or nothing. With `admit` false, the session enters even beyond `limits.sessions`, and
        its agents even if there is no time for them. `examined`: `examine(record)` has been called.
        `live`: rows of its agents. With these, agents wait until `freeze` ends, and continue as if
        nothing had happened. Raises InvalidArgument, AlreadyExists, ResourceExhausted, and
        FailedPrecondition if its scene is not on this server.
        """
        if not examined:
            self.examine(record)
        spec = replace(record.spec, session_id=record.session_id)
        session = self._add(spec, record.created_at, admit)
        try:
            for number, agent in enumerate(record.agents):
                self._check_new(agent, f"agents[{number}]")
            genders = [agent.spec.gender for agent in record.agents]
            wanted = Reservation.of(record.session_id, genders)
            self.load.check_room(wanted, now, self.load.reservations.all(), admit)
            agents = self.population.put(session, record.agents, now)
            session.last_alias = record.last_alias
            if live is not None:
                self._go_on(session, agents, live, now)
            for entered in agents:
                self.goals.restore(entered, in_mid_part=live is not None)
        except Exception:
            for entered in tuple(session.agents.values()):
                self.population.remove(entered)
            self._remove(session)
            raise
        name, observers = session.session_id, self.observers
        observers.tell(lambda observer: observer.opened(session), name)
        observers.tell(lambda observer: observer.created(session, agents, record.agents), name)
        return session

    # Moves to another server

    def freeze(self, session: Session, frozen: bool) -> bool:
        """Stops or resumes the planning of a session's agents; planned chunks are still sent.

        Returns whether nothing is being made for them any more.
        """
        session.frozen = frozen
        rows = _rows(session)
        self.slots.frozen[rows] = frozen
        return not self.slots.engine_call[rows].any()

    def live_rows(self, session: Session, show: Callable[[Index], Double]) -> LiveRows:
        """Rows of a frozen session whose chunks are all sent; `show(rows)` returns due times."""
        slots, rows = self.slots, _rows(session)
        route, way = self.routes.take(rows)
        return LiveRows(
            shown_at=show(rows),
            replanned=slots.replanned[rows],
            held=slots.held[rows],
            near_since=slots.near_since[rows],
            route=route,
            way=way,
            begun_seq=np.array([a.begun_seq for a in session.agents.values()], np.int64),
        )

    def _go_on(self, session: Session, agents: Sequence[Agent], live: LiveRows, now: float) -> None:
        slots, rows = self.slots, _rows(session)
        slots.replanned[rows] = live.replanned
        slots.held[rows] = live.held
        slots.near_since[rows] = live.near_since
        self.routes.put(rows, live.route, live.way)
        for agent, begun in zip(agents, live.begun_seq.tolist(), strict=True):
            agent.begun_seq = begun
        self.population.keep_schedule(rows.tolist(), live.shown_at, now)
        self.freeze(session, True)

    def is_settled(self, session_id: str) -> bool:
        """Whether no chunk that was planned before its agent's last command waits to be sent.

        Then the session can be taken out so that it continues bit for bit. Raises NotFound.
        """
        agents = self.registry.session(session_id).agents.values()
        return all(self.slots.sent_chunks[a.slot] >= a.commanded_seq for a in agents)

    def put_agent(self, session_id: str, record: AgentRecord, now: float) -> Agent:
        """Resumes a recorded agent: its next chunk follows the last one that it sent.

        Raises NotFound, InvalidArgument, AlreadyExists, ResourceExhausted.
        """
        session = self.registry.session(session_id)
        check_agent_record(record, self.limits, "agent")
        self._check_new(record, "agent")
        if record.alias in {agent.alias for agent in session.agents.values()}:
            raise AlreadyExists(f"session {session_id!r} has an agent of alias {record.alias}")
        self.load.room_for(session_id, [record.spec.gender], now)
        [agent] = self.population.put(session, [record], now)
        self.settle(session, [agent], [record])
        return agent

    # Private

    def _add(self, spec: SessionSpec, created_at: float, admit: bool = True) -> Session:
        session = self.registry.add_session(spec, created_at, admit)
        try:
            session.scene = self.scenery.enter(spec, session.session_id)
        except WayfarerError:
            del self.registry.sessions[session.session_id]
            raise
        return session

    def _remove(self, session: Session) -> None:
        del self.registry.sessions[session.session_id]
        self.scenery.leave(session.spec, session.session_id)

    def _check_new(self, record: AgentRecord, where: str) -> None:
        """Raises AlreadyExists, and InvalidArgument when its path is too long for this world."""
        if record.agent_id in self.registry.agents:
            raise AlreadyExists(f"agent {record.agent_id!r} exists already")
        self.goals.check_record(record, where)


def _rows(session: Session) -> Index:
    return np.array([agent.slot for agent in session.agents.values()], np.int64)
