"""The synchronous core: sessions, agents and goals; agents move as time passes.

Time is always an argument: seconds, the same line for all calls (Unix time in the service, any in
offline use). The same calls give the same motion. Not thread-safe, except `placed`, `prepare`,
`reserve` and `examine`.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.engines.engine import Engine
from wayfarer.engines.models import Models
from wayfarer.errors import AlreadyExists, ResourceExhausted, WayfarerError
from wayfarer.navigation.scene import Scene
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import (
    AgentChange,
    AgentInfo,
    AgentSpec,
    AgentState,
    MotionChunk,
    SessionInfo,
    SessionSpec,
)
from wayfarer.world.agents.population import Population
from wayfarer.world.agents.records import AgentRecord, SessionRecord
from wayfarer.world.agents.registry import Agent, Registry, Session
from wayfarer.world.agents.reservations import Reservation
from wayfarer.world.agents.slots import Mode, Motion, SlotTable
from wayfarer.world.agents.timeline import Timeline
from wayfarer.world.agents.views import agent_info
from wayfarer.world.events import Event
from wayfarer.world.goal_commands import GoalCommands
from wayfarer.world.goals.checks import check_change, check_session, check_specs
from wayfarer.world.goals.commands import GoalCommand
from wayfarer.world.goals.paths import Paths
from wayfarer.world.observer import Start, WorldObserver
from wayfarer.world.record_checks import check_agent_record, check_session_record
from wayfarer.world.rows import Index
from wayfarer.world.scenes.context import SceneContext
from wayfarer.world.scenes.grounding import ground
from wayfarer.world.scenes.guide import SceneGuide
from wayfarer.world.scenes.messages import Crowd, CrowdState
from wayfarer.world.scenes.populate import Crowds, Whereabouts
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.stepping.budget import DegradationLevel
from wayfarer.world.stepping.cleanup import clean_feet
from wayfarer.world.stepping.due import Due, due_by_session
from wayfarer.world.stepping.load import Load
from wayfarer.world.stepping.playback import Playback
from wayfarer.world.stepping.scheduler import Launch, PendingStep, Scheduler, at_once
from wayfarer.world.stepping.settings import WorldSettings


class World:
    """Sessions of agents that walk. `tick` moves them all.

    Parts: `registry` (sessions and agents by id), `slots` (their columns), `scheduler`, `load`.
    Others may read them; only the world changes them.
    """

    def __init__(
        self,
        engine: Engine | Models,
        bodies: Mapping[str, BodyModel],
        start_poses: NDArray[np.float32],
        settings: WorldSettings | None = None,
        scenes: SceneRegistry | None = None,
    ) -> None:
        """`bodies` by gender; `start_poses` [P, 22, 4] from `spawn.load_start_poses`.

        Worlds may share `Models` and `scenes`, those that sessions may be in. A world of a single
        engine needs no `Models`.
        """
        self.settings = settings = settings or WorldSettings()
        self.models = engine if isinstance(engine, Models) else Models(engine)
        self._observers: list[WorldObserver] = []
        self._checkpoints = 0
        self._timeline = Timeline()
        self.registry = Registry(settings.limits, settings.shard)
        table = SlotTable(settings.limits.agents)
        self.slots = table.rows
        self._playback = Playback(self.slots, settings.lead)
        # What is planned may be a goal ahead of what is sent for each chunk of it; an agent that
        # wanders has one more.
        paths = Paths(self.slots, settings.limits.path_goals + settings.lead + 2)
        self._scene_context = SceneContext(
            book=scenes or SceneRegistry(),
            slots=self.slots,
            paths=paths,
            timeline=self._timeline,
            settings=settings,
        )
        self._goals = GoalCommands(
            slots=self.slots,
            paths=paths,
            playback=self._playback,
            timeline=self._timeline,
            settings=settings,
            registry=self.registry,
            around=self._scene_context,
        )
        self._population = Population(
            bodies=bodies,
            start_poses=start_poses,
            phases=settings.phases,
            lead=settings.lead,
            registry=self.registry,
            table=table,
            timeline=self._timeline,
            models=self.models,
        )
        self.scheduler = Scheduler(
            table=table,
            playback=self._playback,
            paths=paths,
            models=self.models,
            settings=settings,
            reset=self._population.stand_again,
            planned=self._planned,
            guide=self._scene_context.guide,
            soles=next(iter(bodies.values())).sole_markers.reshape(2, -1),
        )
        self.load = Load(
            settings=settings,
            registry=self.registry,
            agents=lambda: self._population.phases.by_gender,
        )
        self._crowds = Crowds(self)

    def observe(self, observer: WorldObserver) -> None:
        """Report every change to `observer` from now on."""
        self._observers.append(observer)

    # Sessions

    def create_session(self, spec: SessionSpec, now: float) -> SessionInfo:
        """Raises InvalidArgument, AlreadyExists, ResourceExhausted, and FailedPrecondition when its
        scene is not here.
        """
        check_session(spec)
        session = self._open(spec, now)
        for observer in self._observers:
            observer.opened(session)
        return session.info()

    def get_session(self, session_id: str) -> SessionInfo:
        """Raises NotFound."""
        return self.registry.session(session_id).info()

    def list_sessions(self) -> list[SessionInfo]:
        """All, oldest first."""
        return [session.info() for session in self.registry.sessions.values()]

    def delete_session(self, session_id: str) -> None:
        """End a session and its agents. Raises NotFound."""
        session = self.registry.session(session_id)
        for agent_id in tuple(session.agents):
            self.delete_agent(agent_id)
        self._close(session)
        for observer in self._observers:
            observer.closed(session)

    def hold(self, session_id: str, until: float) -> None:
        """Let a session's agents wait: their next frames are shown at `until` or later.

        They are neither planned nor sent before; nothing is lost, and sequence numbers and frames
        go on. No other session notices. Raises NotFound.
        """
        slots = [agent.slot for agent in self.registry.session(session_id).agents.values()]
        self._playback.hold(np.array(slots, np.int64), self._timeline.frame(until))

    def take_session(self, session_id: str) -> SessionRecord:
        """The session as of the last chunks sent; it stays here. Raises NotFound."""
        session = self.registry.session(session_id)
        return SessionRecord(
            session_id=session_id,
            spec=session.spec,
            created_at=session.created_at,
            last_alias=session.last_alias,
            agents=tuple(self._take(agent) for agent in session.agents.values()),
        )

    def examine(self, record: SessionRecord) -> None:
        """The costly part of `put_session`; thread-safe. Raises InvalidArgument."""
        check_session_record(record, self.settings.limits)
        self._population.measure(agent.spec for agent in record.agents)

    def put_session(
        self, record: SessionRecord, now: float, admit: bool = True, examined: bool = False
    ) -> SessionInfo:
        """Let a recorded session go on: the next chunk of each agent follows its last one.

        All or nothing. Not `admit`: agents are let in even if there is no time for them.
        `examined`: `examine(record)` has been called. Raises InvalidArgument, AlreadyExists,
        ResourceExhausted, and FailedPrecondition when its scene is not here.
        """
        if not examined:
            self.examine(record)
        spec = replace(record.spec, session_id=record.session_id)
        session = self._open(spec, record.created_at)
        try:
            for number, agent in enumerate(record.agents):
                self._check_new(agent, f"agents[{number}]")
            genders = [agent.spec.gender for agent in record.agents]
            wanted = Reservation.of(record.session_id, genders)
            self.load.check_room(wanted, now, self.load.held(), admit)
        except WayfarerError:
            self._close(session)
            raise
        for observer in self._observers:
            observer.opened(session)
        agents = self._population.put(session, record.agents, now)
        session.last_alias = record.last_alias
        self._created(session, agents, record.agents)
        return session.info()

    def is_settled(self, session_id: str) -> bool:
        """No chunk waits to be sent that was planned before its agent's last command.

        Then the session can be taken out so that it goes on bit for bit. Raises NotFound.
        """
        agents = self.registry.session(session_id).agents.values()
        return all(self.slots.sent_chunks[a.slot] >= a.commanded_seq for a in agents)

    # Agents

    def placed(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentSpec]:
        """New agents where they will stand: in a scene, on the nearest free ground. Thread-safe.

        Raises NotFound, InvalidArgument.
        """
        check_specs(specs)
        return self._scene_context.scenery.placed(self.registry.session(session_id).spec, specs)

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
        """Hold room for `create_agents` while `prepare` runs. Thread-safe.

        Entering it raises NotFound, InvalidArgument, ResourceExhausted.
        """
        check_specs(specs)
        return self.load.reserve(Reservation.of(session_id, [s.gender for s in specs]), now)

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

        With a valid `reservation`, room is not checked again. Raises NotFound, InvalidArgument,
        ResourceExhausted.
        """
        session = self.registry.session(session_id)
        if seeds is None:
            specs = self.placed(session_id, specs)
            seeds = self.prepare(specs)
        held = self.load.held()
        if reservation not in held:  # it is not held any more when its caller has given up
            wanted = Reservation.of(session_id, [spec.gender for spec in specs])
            self.load.check_room(wanted, now, held)
        agents = self._population.add(session, specs, seeds, now)
        if reservation is not None:
            self.load.release(reservation)
        self._created(session, agents, specs)
        return [self._info(agent) for agent in agents]

    def get_agent(self, agent_id: str) -> AgentInfo:
        """Raises NotFound."""
        return self._info(self.registry.agent(agent_id))

    def list_agents(self, session_id: str) -> list[AgentInfo]:
        """In order of creation. Raises NotFound."""
        return [self._info(agent) for agent in self.registry.session(session_id).agents.values()]

    def session_of(self, agent_id: str) -> str:
        """Id of an agent's session. Raises NotFound."""
        return self.registry.agent(agent_id).session_id

    def update_agent(self, agent_id: str, change: AgentChange) -> AgentInfo:
        """From the next chunk that is sent on. Raises NotFound, InvalidArgument."""
        agent = self.registry.agent(agent_id)
        check_change(change)
        self._population.change(agent, change)
        for observer in self._observers:
            observer.changed(agent, change, int(self.slots.sent_chunks[agent.slot]))
        return self._info(agent)

    def delete_agent(self, agent_id: str) -> None:
        """Its planned frames are thrown away. Raises NotFound."""
        agent = self.registry.agent(agent_id)
        for observer in self._observers:
            observer.deleted(agent, int(self.slots.sent_chunks[agent.slot]))
        self._population.remove(agent)

    def take_agent(self, agent_id: str) -> AgentRecord:
        """The agent as of the last chunk sent; it stays here. Raises NotFound."""
        return self._take(self.registry.agent(agent_id))

    def put_agent(self, session_id: str, record: AgentRecord, now: float) -> AgentInfo:
        """Let a recorded agent go on: its next chunk follows the last one it sent.

        Raises NotFound, InvalidArgument, AlreadyExists, ResourceExhausted.
        """
        session = self.registry.session(session_id)
        check_agent_record(record, self.settings.limits, "agent")
        self._check_new(record, "agent")
        if record.alias in {agent.alias for agent in session.agents.values()}:
            raise AlreadyExists(f"session {session_id!r} has an agent of alias {record.alias}")
        self.load.room_for(session_id, [record.spec.gender], now)
        [agent] = self._population.put(session, [record], now)
        self._created(session, [agent], [record])
        return self._info(agent)

    def use_model(self, name: str) -> list[AgentInfo]:
        """Let all agents be moved by a loaded model; what is planned stays.

        Returns the agents that another model moved before. Raises NotFound.
        """
        model, agents = self.models.named(name), self.registry.agents.values()
        return [self._info(agent) for agent in agents if self._population.move(agent, model)]

    # Goals

    def give(
        self, agent_id: str, command: GoalCommand, now: float, expected: int | None = None
    ) -> int:
        """Carry out a goal command, or one that a `WorldObserver` received; return the revision.

        In a scene, goals off free ground are moved to the nearest that can be reached. Raises
        NotFound, InvalidArgument that names the field, FailedPrecondition (a behaviour that cannot
        work in this session), Aborted when the agent's revision is not `expected`, and Unreachable
        when no way leads to a goal.
        """
        agent = self.registry.agent(agent_id)
        self._goals.check(agent, command, expected)
        fitted, moves = self._scene_context.fitted(agent.slot, command)
        self._goals.give(agent, fitted, now)
        for observer in self._observers:
            observer.commanded(agent, fitted, agent.commanded_seq)
        self._scene_context.tell_moves(agent.slot, moves, agent.passed + len(agent.path))
        return int(self.slots.goal_revision[agent.slot])

    # Scenes and crowds

    @property
    def scenes(self) -> SceneRegistry:
        """Those that sessions may be in."""
        return self._scene_context.scenery.book

    @property
    def guide(self) -> SceneGuide:
        """What leads its agents through scenes."""
        return self._scene_context.guide

    def scene_of_session(self, session_id: str) -> Scene | None:
        """Its scene as the present step sees it; None: it is in none, or has ended."""
        session = self.registry.sessions.get(session_id)
        if session is None or not session.spec.scene:
            return None
        scenery = self._scene_context.scenery
        return scenery.scene(scenery.number(session.spec.scene))

    def whereabouts(self, session_id: str) -> Whereabouts:
        """Where a session's agents are, and who stands, as of what was sent. Raises NotFound."""
        agents = self.registry.session(session_id).agents
        rows = np.array([agent.slot for agent in agents.values()], np.int64)
        sent = self.slots.committed
        stands = sent.gait.mode[rows] == Mode.STANDING
        return Whereabouts(tuple(agents), sent.seed.translation[rows, -1, :2], stands)

    def populate(self, session_id: str, crowd: Crowd, now: float) -> None:
        """Let people come and go from now on, in place of an earlier crowd; see `Crowds.set`."""
        self._crowds.set(session_id, crowd, now)

    def crowd(self, session_id: str) -> CrowdState:
        """How a session's crowd is now. Raises NotFound."""
        return self._crowds.state(session_id)

    def tend(self, now: float) -> list[tuple[str, str]]:
        """Let people of crowds come and go. Returns session and agent of each that has gone."""
        return self._crowds.tend(now)

    # Time

    def schedule(
        self, now: float, launch: Launch = at_once, rung: DegradationLevel | None = None
    ) -> PendingStep | None:
        """Start an engine call for the agents most urgently due; see `Scheduler.begin`.

        On the level of degradation that the load asks for, unless `rung` is given. If the level
        says so, agents that are due and have nothing to do are held before. None: nobody is due.
        """
        frame = self._timeline.frame(now)
        self._scene_context.refresh()
        self._goals.walk_on(frame + self.settings.batch_lookahead_s * FPS)
        if rung is None:
            slack, scheduler = self._playback.slack(frame) / FPS, self.scheduler
            rung = self.load.allow(now, slack, scheduler.held_share, scheduler.under_way)
        if rung.hold_idle:
            self.scheduler.hold(frame)
        return self.scheduler.begin(frame, rung.candidates, launch)

    def apply(self, step: PendingStep) -> int:
        """Plan the chunks that a scheduled step has made; returns how many agents it stepped."""
        return self.scheduler.finish(step)

    def step(self, now: float, rung: DegradationLevel | None = None) -> int:
        """`schedule`, then `apply`. Returns how many agents were stepped."""
        step = self.schedule(now, rung=rung)
        return 0 if step is None else self.apply(step)

    def take_due(self, until: float) -> list[Due]:
        """The planned chunks that are to be shown by `until`, by session.

        A session comes again for an agent's next chunk.
        """
        found = list[Due]()
        for sent in self._playback.send(self._timeline.frame(until)):
            clean_feet(self.slots, sent)
            ground(self.slots, self._scene_context.scenery, sent)
            found += due_by_session(sent, self.slots, self.registry.by_slot, self._timeline)
        for observer in self._observers:
            for due in found:
                observer.sent(due)
        return found

    def collect(self, until: float) -> list[MotionChunk]:
        """The same chunks in one list; each session's in order of their times."""
        return [chunk for due in self.take_due(until) for chunk in due.chunks]

    def tick(self, now: float) -> list[MotionChunk]:
        """Tend crowds, step all agents that are due, return the chunks whose time has come."""
        self.tend(now)
        sent = self.collect(now)
        while (event := self.next_event()) is not None and event <= now:
            self.step(now)
            sent += self.collect(now)
        return sent

    def advance(self, until: float) -> Iterator[MotionChunk]:
        """Run from event to event, without waiting, as far as `until`."""
        while (event := self.next_event()) is not None and event <= until:
            yield from self.tick(event)

    def next_event(self, planning: bool = True, early: float = 0.0) -> float | None:
        """When the next chunk is to be sent or, unless not asked for, planned; None without any.

        Chunks are sent so many seconds `early`.
        """
        frame = self._playback.next_event(planning, early * FPS)
        return None if frame is None else self._timeline.time(frame)

    def behind(self, now: float) -> float:
        """Seconds by which the next chunk to be sent is overdue; 0 when none is."""
        frame = self._playback.next_send()
        return 0.0 if frame is None else max(now - self._timeline.time(frame), 0.0)

    def rebase(self, seconds: float) -> None:
        """Move everything not yet sent to `seconds` later, when the clock has run away."""
        self._timeline.move(seconds)

    def take_events(self) -> list[tuple[str, Event]]:
        """What agents have met with on their ways since the last time, by session."""
        agents = self.registry.agents
        events = self._scene_context.take_events()
        return [(agents[e.agent_id].session_id, e) for e in events if e.agent_id in agents]

    def checkpoint(self, parts: int = 1) -> None:
        """Report to observers where agents stand: one agent in `parts`, in turn."""
        self._checkpoints += 1
        agents = list(self.registry.agents.values())[self._checkpoints % parts :: parts]
        if agents:
            for observer in self._observers:
                observer.stood(agents)

    def states(self) -> dict[AgentState, int]:
        """How many agents are in each state, as of what has been sent."""
        slots = self.slots
        counts = np.bincount(slots.committed.gait.mode[slots.active], minlength=len(Mode))
        states = dict.fromkeys(AgentState, 0)
        for mode in Mode:
            states[mode.state] += int(counts[mode])
        return states

    # Within

    def _open(self, spec: SessionSpec, created_at: float) -> Session:
        scenery = self._scene_context.scenery
        scenery.enter(spec)
        try:
            session = self.registry.add_session(spec, created_at)
        except WayfarerError:
            scenery.leave(spec)
            raise
        session.scene = scenery.number(spec.scene)
        return session

    def _close(self, session: Session) -> None:
        del self.registry.sessions[session.session_id]
        self._scene_context.scenery.leave(session.spec)

    def _check_new(self, record: AgentRecord, where: str) -> None:
        """Raises AlreadyExists, and InvalidArgument when its path is too long for this world."""
        if record.agent_id in self.registry.agents:
            raise AlreadyExists(f"agent {record.agent_id!r} exists already")
        self._goals.check_record(record, where)

    def _take(self, agent: Agent) -> AgentRecord:
        return self._population.take(agent, self._goals.at_rest(agent))

    def _created(self, session: Session, agents: Sequence[Agent], starts: Sequence[Start]) -> None:
        """Let agents that are in their slots follow their paths, and report them."""
        for agent in agents:
            self._goals.restore(agent)
        for observer in self._observers:
            observer.created(session, agents, starts)

    def _planned(self, rows: Index, seqs: Index, candidates: int) -> None:
        if not self._observers:
            return
        numbers = self.slots.model[rows].tolist()
        stamps = {number: self.models.numbered(number).stamp for number in set(numbers)}
        models = [stamps[number] for number in numbers]
        for observer in self._observers:
            observer.planned(self.slots.agent_id[rows], seqs, candidates, models)

    def _info(self, agent: Agent) -> AgentInfo:
        return agent_info(agent, self.slots, self.models)
