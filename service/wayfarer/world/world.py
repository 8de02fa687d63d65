"""The synchronous core: sessions, agents and goals. Agents move as time passes.

Time is always an argument: seconds on the same line for all calls (Unix time in the service, any in
offline use). The same calls give the same motion. Not thread-safe, except `placed`, `prepare`,
`reserve` and `examine`.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.engines.engine import Engine
from wayfarer.engines.models import LoadedModels
from wayfarer.errors import ResourceExhausted
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.world.agents.agent import (
    AgentChange,
    AgentInfo,
    AgentSpec,
    MotionChunk,
    SessionInfo,
    SessionSpec,
    Sight,
)
from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.checks import check_change, check_session, check_specs
from wayfarer.world.agents.faults import Fault, Faults, Report, Stage
from wayfarer.world.agents.population import Population
from wayfarer.world.agents.records import LiveRows
from wayfarer.world.agents.registry import Registry
from wayfarer.world.agents.reservations import Reservation
from wayfarer.world.agents.slots import Motion, SlotTable
from wayfarer.world.agents.timeline import Timeline
from wayfarer.world.agents.views import agent_info, distant_by_gender
from wayfarer.world.events import Event
from wayfarer.world.goal_commands import GoalCommands
from wayfarer.world.goals.commands import GoalCommand
from wayfarer.world.goals.path_columns import PathColumns
from wayfarer.world.membership import Membership
from wayfarer.world.observer import Observers, WorldObserver
from wayfarer.world.output.footlock import leg_shares
from wayfarer.world.rows import Index
from wayfarer.world.scenes.context import SceneContext
from wayfarer.world.scenes.guide import SceneGuide
from wayfarer.world.scenes.populate import Crowds
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.sending import Sending
from wayfarer.world.stepping.budget import DegradationLevel
from wayfarer.world.stepping.due import Due
from wayfarer.world.stepping.engine_call import Launch, PendingStep, at_once
from wayfarer.world.stepping.load import Load
from wayfarer.world.stepping.mirror import has_mirror_image
from wayfarer.world.stepping.playback import Playback
from wayfarer.world.stepping.scheduler import Scheduler
from wayfarer.world.stepping.settings import WorldSettings


class World:
    """Sessions of walking agents. `tick` moves them all.

    Parts: `registry` (sessions and agents by id), `slots` (their columns), `scheduler`, `load`.
    Others may read them; only the world changes them. `members` takes sessions and agents out as
    records and puts them in; `crowds` makes people come and go.
    """

    def __init__(
        self,
        engine: Engine | LoadedModels,
        bodies: Mapping[str, BodyModel],
        start_poses: NDArray[np.float32],
        settings: WorldSettings | None = None,
        scenes: SceneRegistry | None = None,
        report: Report | None = None,
    ) -> None:
        """`bodies` by gender; `start_poses` [P, 22, 4] from `spawn.load_start_poses`.

        Worlds may share `LoadedModels`, and `scenes` that sessions may be in. A world with one
        engine needs no `LoadedModels`. `report`: see `Faults`; without it, every error is raised.
        """
        self.settings = settings = settings or WorldSettings()
        self.models = engine if isinstance(engine, LoadedModels) else LoadedModels(engine)
        self._checkpoints = 0
        self._timeline = Timeline()
        self.registry = Registry(settings.limits, settings.new_group)
        table = SlotTable(settings.limits.agents)
        self.slots = table.rows
        self.faults = Faults(self.slots, self.registry, report and self._noted(report))
        self._observers = Observers(self.faults, self.slots, self.models)
        self._playback = Playback(self.slots, settings.lead)
        # A plan may be one goal ahead of the sent motion for each of its chunks; a wandering agent
        # has one goal more.
        paths = PathColumns(self.slots, settings.limits.path_goals + settings.lead + 2)
        self._scene_context = SceneContext(
            registry=scenes or SceneRegistry(),
            slots=self.slots,
            paths=paths,
            timeline=self._timeline,
            settings=settings,
            faults=self.faults,
        )
        self._goals = GoalCommands(
            slots=self.slots,
            paths=paths,
            playback=self._playback,
            timeline=self._timeline,
            settings=settings,
            registry=self.registry,
            around=self._scene_context,
            faults=self.faults,
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
            planned=self._observers.planned,
            fell=self._observers.fell,
            guide=self._scene_context.guide,
            mirrors=has_mirror_image(bodies.values()),
            shares=leg_shares(next(iter(bodies.values())).marker_names),
            faults=self.faults,
        )
        self.load = Load(
            settings=settings,
            registry=self.registry,
            agents=lambda: self._population.phases.by_gender,
            distant=lambda: distant_by_gender(self.slots),
        )
        self.members = Membership(
            registry=self.registry,
            slots=self.slots,
            population=self._population,
            goals=self._goals,
            scenery=self._scene_context.scenery,
            routes=self._scene_context.routes,
            load=self.load,
            limits=settings.limits,
            observers=self._observers,
            faults=self.faults,
        )
        scenery = self._scene_context.scenery
        self.crowds = Crowds(self, self.registry, self.slots, scenery, self.faults)
        self._sending = Sending(
            slots=self.slots,
            registry=self.registry,
            timeline=self._timeline,
            scenery=scenery,
            observers=self._observers,
            faults=self.faults,
            rules=self.settings.rules,
        )

    def observe(self, observer: WorldObserver) -> None:
        """Reports every change to `observer` from now on."""
        self._observers.add(observer)

    # Sessions

    def create_session(self, spec: SessionSpec, now: float) -> SessionInfo:
        """Raises InvalidArgument, AlreadyExists, ResourceExhausted, and FailedPrecondition if its
        scene is not on this server.
        """
        check_session(spec)
        return self.members.open(spec, now).info()

    def get_session(self, session_id: str) -> SessionInfo:
        """Raises NotFound."""
        return self.registry.session(session_id).info()

    def list_sessions(self) -> list[SessionInfo]:
        """All sessions, oldest first."""
        return [session.info() for session in self.registry.sessions.values()]

    def delete_session(self, session_id: str) -> None:
        """Ends a session and its agents. Raises NotFound."""
        self.members.close(self.registry.session(session_id))

    def freeze_all(self, session_id: str) -> None:
        """Plans nothing more for the agents of a session, even if only parts of it remain."""
        slots = [slot for slot, a in self.registry.by_slot.items() if a.session_id == session_id]
        self.slots.frozen[slots] = True

    def hold(self, session_id: str, until: float) -> None:
        """Makes a session's agents wait: their next frames are shown at `until` or later.

        They are not planned or sent before. Nothing is lost; sequence numbers and frames continue.
        Other sessions are not affected. Raises NotFound.
        """
        slots = [agent.slot for agent in self.registry.session(session_id).agents.values()]
        self._playback.hold(np.array(slots, np.int64), self._timeline.frame(until))

    # Agents

    def placed(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentSpec]:
        """New agents at the places where they will stand: in a scene, on the nearest free ground.

        Thread-safe. Raises NotFound, InvalidArgument.
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
        """Holds room for `create_agents` while `prepare` runs. Thread-safe.

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
        names: Sequence[str] = (),
    ) -> list[AgentInfo]:
        """Creates all or none, with the ids `names` if they are given. `seeds` are the result of
        `prepare(specs)`, if it has been called; then `specs` are the result of `placed`.

        With a valid `reservation`, room is not checked again. Raises NotFound, InvalidArgument,
        ResourceExhausted.
        """
        session = self.registry.session(session_id)
        if seeds is None:
            specs = self.placed(session_id, specs)
            seeds = self.prepare(specs)
        held = self.load.reservations.all()
        if reservation not in held:  # it has been released if its caller has given up
            wanted = Reservation.of(session_id, [spec.gender for spec in specs])
            self.load.check_room(wanted, now, held)
        agents = self._population.add(session, specs, seeds, now, names)
        if reservation is not None:
            self.load.reservations.release(reservation)
        self.members.settle(session, agents, specs)
        return [self._info(agent) for agent in agents]

    def get_agent(self, agent_id: str) -> AgentInfo:
        """Raises NotFound."""
        return self._info(self.registry.agent(agent_id))

    def list_agents(self, session_id: str) -> list[AgentInfo]:
        """Agents in order of creation. Raises NotFound."""
        return [self._info(agent) for agent in self.registry.session(session_id).agents.values()]

    def session_of(self, agent_id: str) -> str:
        """Id of an agent's session. Raises NotFound."""
        return self.registry.agent(agent_id).session_id

    def update_agent(self, agent_id: str, change: AgentChange) -> AgentInfo:
        """Changes an agent from the next planned chunk on. Raises NotFound, InvalidArgument."""
        agent = self.registry.agent(agent_id)
        check_change(change)
        self._population.change(agent, change)
        seq = int(self.slots.planned_chunks[agent.slot])
        self._observers.tell(lambda o: o.changed(agent, change, seq), agent.session_id)
        return self._info(agent)

    def delete_agent(self, agent_id: str) -> None:
        """Deletes an agent; its planned frames are discarded. Raises NotFound."""
        self.members.remove(self.registry.agent(agent_id))

    def use_model(self, name: str) -> list[AgentInfo]:
        """Moves all agents with a loaded model; plans stay.

        Returns the agents that another model moved before. Raises NotFound.
        """
        model, agents = self.models.named(name), self.registry.agents.values()
        return [self._info(agent) for agent in agents if self._population.move(agent, model)]

    # Goals

    def give(
        self, agent_id: str, command: GoalCommand, now: float, expected: int | None = None
    ) -> int:
        """Carries out a goal command, also from a `WorldObserver`; returns the revision.

        In a scene, goals off free ground are moved to the nearest reachable place. Raises NotFound,
        InvalidArgument that names the field, FailedPrecondition (a behaviour that cannot work in
        this session), Aborted if the agent's revision is not `expected`, and Unreachable if no way
        leads to a goal.
        """
        agent = self.registry.agent(agent_id)
        self._goals.check(agent, command, expected)
        fitted, moves = self._scene_context.fitted(agent.slot, command)
        self._goals.give(agent, fitted, now)
        seq = agent.commanded_seq
        self._observers.tell(lambda o: o.commanded(agent, fitted, seq), agent.session_id)
        self._scene_context.tell_moves(agent.slot, moves, agent.passed + len(agent.path))
        return int(self.slots.goal_revision[agent.slot])

    # Scenes

    @property
    def scenes(self) -> SceneRegistry:
        """The scenes that sessions may be in."""
        return self._scene_context.scenery.registry

    @property
    def guide(self) -> SceneGuide:
        """The guide of its agents through scenes."""
        return self._scene_context.guide

    # Time

    def schedule(
        self, now: float, launch: Launch = at_once, level: DegradationLevel | None = None
    ) -> PendingStep | None:
        """Starts an engine call for the agents most urgently due; see `Scheduler.begin`.

        It uses the degradation level that the load requires, unless `level` is given. If the level
        says so, agents that are seen only as a root coast first, and due agents with nothing to do
        are held. None: there is no batch to step.
        """
        frame, self.faults.now = self._timeline.frame(now), now
        self._scene_context.refresh()
        self._goals.update_behaviours(frame + self.settings.batch_lookahead_s * FPS)
        if level is None:
            slack, scheduler = self._playback.slack(frame) / FPS, self.scheduler
            level = self.load.allow(
                now, slack, scheduler.held_share, scheduler.under_way, scheduler.is_any_distant
            )
        if level.by_sight:
            self.scheduler.unstepped.coast(frame)
        if level.hold_idle:
            self.scheduler.unstepped.hold(frame)
        step = self.scheduler.begin(frame, level, launch)
        if self.faults.any:
            self.scheduler.unstepped.stand_aside(frame)
        return step

    def apply(self, step: PendingStep) -> int:
        """Plans the chunks that a scheduled step has made; returns how many agents it stepped."""
        return self.scheduler.finish(step)

    def step(self, now: float, level: DegradationLevel | None = None) -> int:
        """`schedule`, then `apply`. Returns how many agents were stepped."""
        step = self.schedule(now, level=level)
        return 0 if step is None else self.apply(step)

    def take_due(self, until: float) -> list[Due]:
        """The planned chunks that are due by `until`, by session.

        A session comes again for an agent's next chunk.
        """
        return self._sending.leave(self._playback.send(self._timeline.frame(until)))

    def see(self, session_id: str, slots: Index, sights: Sequence[Sight] | Sight) -> None:
        """Sets how well these agents of a session are seen. Agents seen better go first when time
        is short. It applies until it is set again; new agents are `NEAR`.

        In a recorded session all are `NEAR`, since a replay has no readers. Raises NotFound.
        """
        recorded = self.registry.session(session_id).spec.record
        self.slots.sight[slots] = Sight.NEAR if recorded else sights

    def take_rest(self, session_id: str) -> list[Due]:
        """All planned chunks of a session's agents, before their time. Raises NotFound.

        Chunks still being made for them are lost, since they would be sent after these.
        """
        agents = self.registry.session(session_id).agents.values()
        rows = np.array([agent.slot for agent in agents], np.int64)
        self.slots.engine_call[rows] = 0
        return self._sending.leave(self._playback.send(np.inf, rows))

    def live_rows(self, session_id: str) -> LiveRows:
        """The columns of a frozen session's agents for another server. Raises NotFound."""
        return self.members.live_rows(self.registry.session(session_id), self._shown_at)

    def _shown_at(self, rows: Index) -> NDArray[np.float64]:
        slots = self.slots
        return self._timeline.times(slots.start_frame[rows] + NEW_FRAMES * slots.sent_chunks[rows])

    def collect(self, until: float) -> list[MotionChunk]:
        """The same chunks in one list; each session's in order of their times."""
        return [chunk for due in self.take_due(until) for chunk in due.chunks]

    def tick(self, now: float) -> list[MotionChunk]:
        """Tends crowds, steps all agents that are due, returns the chunks whose time has come."""
        self.crowds.tend(now)
        sent = self.collect(now)
        while (event := self.next_event()) is not None and event <= now:
            self.step(now)
            sent += self.collect(now)
        return sent

    def advance(self, until: float) -> Iterator[MotionChunk]:
        """Runs from event to event, without waiting, up to `until`."""
        while (event := self.next_event()) is not None and event <= until:
            yield from self.tick(event)

    def next_event(self, planning: bool = True, early: float = 0.0) -> float | None:
        """The time at which the next chunk is sent or, with `planning`, planned; None without any.

        Chunks are sent `early` seconds early.
        """
        frame = self._playback.next_event(planning, early * FPS)
        return None if frame is None else self._timeline.time(frame)

    def skip(self, now: float) -> Index:
        """Leaves out primitives that could no longer be seen in time; returns their numbers by
        `Sight`.

        An agent that is late by more than a primitive continues in place rather than where it would
        be: overdue primitives are not made, and take no time from others.
        """
        return self._playback.skip(self._timeline.frame(now))

    def take_events(self) -> list[tuple[str, Event]]:
        """The events of agents on their ways since the last call, by session."""
        agents = self.registry.agents
        events = self._scene_context.take_events()
        found = [(agents[e.agent_id].session_id, e) for e in events if e.agent_id in agents]
        return found + [
            (session_id, event)
            for session_id, event in self.faults.take_events()
            if session_id in self.registry.sessions
            and (not event.agent_id or event.agent_id in agents)
        ]

    def checkpoint(self, parts: int = 1) -> None:
        """Reports to observers where agents stand: one agent in `parts`, in turn."""
        self._checkpoints += 1
        agents = list(self.registry.agents.values())[self._checkpoints % parts :: parts]
        if agents:
            self._observers.stood(agents)

    # Private

    def _noted(self, report: Report) -> Report:
        def noted(fault: Fault) -> None:
            report(fault)
            if fault.agent_id or fault.stage is Stage.RECORD:
                self._observers.strayed(fault.session_id, fault.agent_id)

        return noted

    def _info(self, agent: Agent) -> AgentInfo:
        return agent_info(agent, self.slots, self.models)
