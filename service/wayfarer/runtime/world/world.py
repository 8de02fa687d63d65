"""The synchronous core: sessions, agents and goals, who move as time passes.

Time is always an argument: seconds, the same line for all calls (Unix time in the service, any
in offline use). The same calls give the same motion. Not thread-safe, `prepare` and `reserve`
excepted.
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from wayfarer.errors import AlreadyExists, ResourceExhausted, WayfarerError
from wayfarer.runtime.agent import (
    AgentChange,
    AgentInfo,
    AgentSpec,
    MotionChunk,
    SessionInfo,
    SessionSpec,
)
from wayfarer.runtime.commands import Command, Delete
from wayfarer.runtime.scenes.messages import Crowd
from wayfarer.runtime.scenes.populate import Crowds
from wayfarer.runtime.world.checks import check_change, check_session, check_specs
from wayfarer.runtime.world.directed import Directed
from wayfarer.runtime.world.handover import (
    AgentRecord,
    SessionRecord,
    check_agent_record,
    check_session_record,
)
from wayfarer.runtime.world.registry import Agent, Session
from wayfarer.runtime.world.reservations import Reservation
from wayfarer.runtime.world.slots import Motion
from wayfarer.runtime.world.views import agent_info


class World(Directed):
    """Sessions of agents who walk. `tick` moves them all."""

    # Sessions

    def create_session(self, spec: SessionSpec, now: float) -> SessionInfo:
        """Raises InvalidArgument, AlreadyExists, ResourceExhausted, and FailedPrecondition when its
        scene is not here.
        """
        check_session(spec)
        return self._open(spec, now).info()

    def get_session(self, session_id: str) -> SessionInfo:
        """Raises NotFound."""
        return self._registry.session(session_id).info()

    def list_sessions(self) -> list[SessionInfo]:
        """All, oldest first."""
        return [session.info() for session in self._registry.sessions.values()]

    def delete_session(self, session_id: str) -> None:
        """End a session and its agents. Raises NotFound."""
        for agent_id in self.get_session(session_id).agent_ids:
            self.delete_agent(agent_id)
        self._close(self._registry.session(session_id))

    def hold(self, session_id: str, until: float) -> None:
        """Let a session's agents wait: their next frames are shown at `until` or later.

        They are neither planned nor sent before; nothing is lost, and sequence numbers and frames
        go on. No other session notices. Raises NotFound.
        """
        slots = [agent.slot for agent in self._registry.session(session_id).agents.values()]
        self._playback.hold(np.array(slots, np.int64), self._timeline.frame(until))

    def take_session(self, session_id: str) -> SessionRecord:
        """The session as of the last chunks sent; it stays here. Raises NotFound."""
        session = self._registry.session(session_id)
        return SessionRecord(
            session_id=session_id,
            spec=session.spec,
            created_at=session.created_at,
            last_alias=session.last_alias,
            agents=tuple(self._population.take(a) for a in session.agents.values()),
        )

    def examine(self, record: SessionRecord) -> None:
        """The costly part of `put_session`; thread-safe. Raises InvalidArgument."""
        check_session_record(record, self.settings.limits)
        self._population.measure(agent.spec for agent in record.agents)

    def put_session(
        self, record: SessionRecord, now: float, admit: bool = True, examined: bool = False
    ) -> SessionInfo:
        """Let a recorded session go on: the next chunk of each agent follows its last one.

        All or nothing. Not `admit`: whether there is time for its agents is not asked. `examined`:
        `examine(record)` has been called. Raises InvalidArgument, AlreadyExists, ResourceExhausted,
        and FailedPrecondition when its scene is not here.
        """
        if not examined:
            self.examine(record)
        spec = replace(record.spec, session_id=record.session_id)
        session = self._open(spec, record.created_at)
        try:
            for number, agent in enumerate(record.agents):
                self._check_new(agent, f"agents[{number}]")
            wanted = Reservation.of(
                record.session_id, [agent.spec.gender for agent in record.agents]
            )
            self._check_room(wanted, now, self._reservations.all(), admit)
        except WayfarerError:
            self._close(session)
            raise
        self._put(session, record.agents, now)
        session.last_alias = record.last_alias
        return session.info()

    # Agents

    def placed(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentSpec]:
        """New agents where they will stand: in a scene, on the nearest free ground. Thread-safe.

        Raises NotFound, InvalidArgument.
        """
        check_specs(specs)
        return self._stage.scenery.placed(self._registry.session(session_id).spec, specs)

    def prepare(self, specs: Sequence[AgentSpec]) -> list[Motion]:
        """Standing seeds for `create_agents`: its costly part, free of state and thread-safe.

        Raises InvalidArgument, ResourceExhausted.
        """
        most = self.settings.limits.agents_per_session
        if len(specs) > most:
            raise ResourceExhausted(f"{len(specs)} agents at once; allowed per session: {most}")
        check_specs(specs)
        self._population.measure(specs)
        return [self._population.spawner.stand(spec) for spec in specs]

    def reserve(
        self, session_id: str, specs: Sequence[AgentSpec], now: float
    ) -> AbstractContextManager[Reservation]:
        """Hold room for `create_agents` while `prepare` is paid. Thread-safe.

        Entering it raises NotFound, InvalidArgument, ResourceExhausted.
        """
        check_specs(specs)
        wanted = Reservation.of(session_id, [spec.gender for spec in specs])
        return self._reservations.held(wanted, partial(self._check_room, wanted, now))

    def create_agents(
        self,
        session_id: str,
        specs: Sequence[AgentSpec],
        now: float,
        seeds: Sequence[Motion] | None = None,
        reservation: Reservation | None = None,
    ) -> list[AgentInfo]:
        """All or none. `seeds` are what `prepare(specs)` returned, if it has been called; then
        `specs` are what `placed` made of them.

        Who comes with a reservation of `reserve(session_id, specs, …)` is not asked again whether
        there is room. Raises NotFound, InvalidArgument, ResourceExhausted.
        """
        session = self._registry.session(session_id)
        if seeds is None:
            specs = self.placed(session_id, specs)
            seeds = self.prepare(specs)
        held = self._reservations.all()
        if reservation not in held:  # or no more: its caller has given up
            wanted = Reservation.of(session_id, [spec.gender for spec in specs])
            self._check_room(wanted, now, held)
        made = []
        for agent in self._population.add(session, specs, seeds, now):
            self._record(agent, agent.spec, 0)
            made.append(self._info(agent))
        if reservation is not None:
            self._reservations.release(reservation)
        return made

    def get_agent(self, agent_id: str) -> AgentInfo:
        """Raises NotFound."""
        return self._info(self._registry.agent(agent_id))

    def list_agents(self, session_id: str) -> list[AgentInfo]:
        """In order of creation. Raises NotFound."""
        return [self._info(agent) for agent in self._registry.session(session_id).agents.values()]

    def session_of(self, agent_id: str) -> str:
        """Id of an agent's session. Raises NotFound."""
        return self._registry.agent(agent_id).session_id

    def update_agent(self, agent_id: str, change: AgentChange) -> AgentInfo:
        """From the next chunk that is sent on. Raises NotFound, InvalidArgument."""
        agent = self._registry.agent(agent_id)
        check_change(change)
        self._population.change(agent, change)
        self._record(agent, change, self._next_sent(agent))
        return self._info(agent)

    def delete_agent(self, agent_id: str) -> None:
        """Its planned frames are thrown away. Raises NotFound."""
        agent = self._registry.agent(agent_id)
        self._record(agent, Delete(), self._next_sent(agent))
        self._population.remove(agent)

    def take_agent(self, agent_id: str) -> AgentRecord:
        """The agent as of the last chunk sent; it stays here. Raises NotFound."""
        return self._population.take(self._registry.agent(agent_id))

    def put_agent(self, session_id: str, record: AgentRecord, now: float) -> AgentInfo:
        """Let a recorded agent go on: its next chunk follows the last one it sent.

        Raises NotFound, InvalidArgument, AlreadyExists, ResourceExhausted.
        """
        session = self._registry.session(session_id)
        check_agent_record(record, self.settings.limits, "agent")
        self._check_new(record, "agent")
        if record.alias in {agent.alias for agent in session.agents.values()}:
            raise AlreadyExists(f"session {session_id!r} has an agent of alias {record.alias}")
        wanted = Reservation.of(session_id, [record.spec.gender])
        self._check_room(wanted, now, self._reservations.all())
        [agent] = self._put(session, [record], now)
        return self._info(agent)

    def use_model(self, name: str) -> list[AgentInfo]:
        """Let all agents be moved by a loaded model; what is planned stays. Who was not before.

        Raises NotFound.
        """
        model, agents = self.models.named(name), self._registry.agents.values()
        return [self._info(agent) for agent in agents if self._population.move(agent, model)]

    # Crowds

    def populate(self, session_id: str, crowd: Crowd, now: float) -> int:
        """Let people come and go from now on, in place of an earlier crowd; see `Crowds.set`."""
        return self._crowds.set(session_id, crowd, now)

    def tend(self, now: float) -> list[tuple[str, str]]:
        """Let those people come and go, again and again. Who has gone: session and agent."""
        return self._crowds.tend(now)

    def tick(self, now: float) -> list[MotionChunk]:
        """Tend crowds, step all agents that are due, return the chunks whose time has come."""
        self.tend(now)
        return super().tick(now)

    # Within

    @cached_property
    def _crowds(self) -> Crowds:
        return Crowds(self)

    def _open(self, spec: SessionSpec, created_at: float) -> Session:
        self._stage.scenery.enter(spec)
        try:
            return self._registry.add_session(spec, created_at)
        except WayfarerError:
            self._stage.scenery.leave(spec)
            raise

    def _close(self, session: Session) -> None:
        del self._registry.sessions[session.session_id]
        self._stage.scenery.leave(session.spec)

    def _check_new(self, record: AgentRecord, where: str) -> None:
        """Raises AlreadyExists, and InvalidArgument when its path is too long for this world."""
        if record.agent_id in self._registry.agents:
            raise AlreadyExists(f"agent {record.agent_id!r} exists already")
        self._orders.check_record(record, where)

    def _put(self, session: Session, records: Sequence[AgentRecord], now: float) -> list[Agent]:
        agents = self._population.put(session, records, now)
        for agent, record in zip(agents, records, strict=True):
            self._record(agent, record, record.seq)
        return agents

    def _record(self, agent: Agent, command: Command, seq: int) -> None:
        if self._recorder is not None:
            self._recorder.command(agent.agent_id, command, seq)

    def _next_sent(self, agent: Agent) -> int:
        return int(self._table.rows.sent_chunks[agent.slot])

    def _info(self, agent: Agent) -> AgentInfo:
        return agent_info(agent, self._table.rows, self.models)
