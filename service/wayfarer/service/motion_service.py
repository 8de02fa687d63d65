"""What every transport calls: real time, lock-step, clips, snapshots, logs and the journal.

A call goes to the world in which its session or agent lives. What changes something returns once
the journal, if there is one and it can write, has it on disk. All methods may be awaited from the
event loop; none blocks it.
"""

import asyncio
from collections.abc import AsyncGenerator, Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from typing import Final

from wayfarer.engines.engine import Engine
from wayfarer.engines.model_store import ModelLoader, no_model
from wayfarer.engines.models import ModelInfo
from wayfarer.errors import AlreadyExists, FailedPrecondition, Unreachable
from wayfarer.service.archive import Archive
from wayfarer.service.gates import SessionGates
from wayfarer.service.live import LiveMotion, steady_clock
from wayfarer.service.lockstep import LockStep, LockSteps
from wayfarer.service.metrics_sink import MetricsSink
from wayfarer.service.moving import LiveMoves
from wayfarer.service.offline import Offline
from wayfarer.service.persistence.log_copy import Replica
from wayfarer.service.persistence.persistence import SAVE_PARTS, Persistence
from wayfarer.service.persistence.record import UNCOPIED, LogMark
from wayfarer.service.scenes import SceneService
from wayfarer.service.stats import LoopStats
from wayfarer.service.streams.publications import Publication, StreamOptions
from wayfarer.service.streams.subscription import Subscription
from wayfarer.service.walk import walk
from wayfarer.service.worlds import Worlds
from wayfarer.world.agents.agent import AgentChange, AgentInfo, AgentSpec, SessionInfo, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.records import SessionRecord
from wayfarer.world.goals.commands import GoalCommand
from wayfarer.world.scenes.prepare import prepare
from wayfarer.world.world import World

TRIAL_SECONDS: Final = 1.0
"""Seconds for which a session is stepped when it is tried."""


class MotionService:
    """Sessions, agents, goals and streams. Scenes have a separate part."""

    def __init__(
        self,
        worlds: Worlds,
        warm_up: Callable[[World], None] = lambda world: None,
        clock: Callable[[], float] | None = None,
        meter: MetricsSink | None = None,
        open_model: Callable[[str], Engine] = no_model,
        may_step: Callable[[], bool] = lambda: True,
        ended: Callable[[], None] = lambda: None,
    ) -> None:
        """`warm_up` is called with the world in real time, on the motion thread before its first
        turn. `open_model(name)` opens one more model, in a separate thread. `may_step`: of
        `Ownership`. `ended()` is called, from another thread, when the motion loop has failed for
        good: nothing works any more, and the process should end.

        What the journal holds is read here and goes on once the thread is warm. Raises
        ArtifactError when that is more than the limits allow.
        """
        self._worlds = worlds
        self._archive = Archive(worlds)
        self._persistence = Persistence(worlds.journal, worlds.settings.limits, meter)
        self._clock = clock or steady_clock()
        self._offline = Offline(worlds.settings.limits.offline_jobs)
        self._model_loader = ModelLoader(worlds.models, open_model)
        self._gates = SessionGates()
        self._door = asyncio.Lock()  # two sessions of one id must not enter different worlds
        self._world = worlds.live()
        self._live = LiveMotion(
            self._world,
            lambda: self._wake(warm_up),
            self._clock,
            meter,
            may_step,
            self._keep_aside,
            ended,
        )
        self._lock_steps = LockSteps(worlds, self._offline, self._clock)
        self.scenes = SceneService(
            book=worlds.scenes,
            persistence=self._persistence,
            live=self._live,
            lock_steps=self._lock_steps,
            clock=self._clock,
            gates=self._gates,
        )

        self.moves = LiveMoves(
            worlds, self._archive, self._live, self._lock_steps, self._persistence, self._gates
        )

    # Life

    def start(self) -> None:
        """Start all threads, once; to be called on the event loop."""
        self._persistence.start(
            lambda: self._live.ask(lambda world, _: world.checkpoint(SAVE_PARTS))
        )
        self._live.start()

    async def stop(self) -> None:
        """End every thread, stream and waiting command; where all stand is saved."""
        self._persistence.pause()
        await asyncio.to_thread(self._worlds.stop)
        await self._live.stop()
        self.scenes.stop()
        await asyncio.to_thread(self._lock_steps.stop, "the server has been stopped")
        self._world.checkpoint()
        await self._persistence.stop(in_good_order=not self._live.failed)

    @property
    def ready(self) -> bool:
        """Models are loaded and warm and the loop is running."""
        return self._live.ready

    @property
    def alive(self) -> bool:
        """The loop has made a turn within the last second."""
        return self._live.alive

    async def stats(self) -> LoopStats:
        """Figures for dashboards and the viewer."""
        return replace(await self._live.stats(), journal_failing=self._persistence.failing)

    # Sessions

    async def create_session(self, spec: SessionSpec) -> SessionInfo:
        """Open a session. Raises AlreadyExists, ResourceExhausted."""
        async with self._gates.through(spec.scene) if spec.scene else nullcontext():
            if spec.session_id is None:  # it gets an id of its own: nobody waits at the door
                made = await self._create_session(spec)
            else:
                async with self._door:
                    await self._refuse_taken(spec.session_id)
                    made = await self._create_session(spec)
            return await self._persistence.durable(made)

    async def get_session(self, session_id: str) -> SessionInfo:
        """Raises NotFound."""
        return await self._home(session_id).ask(lambda world, _: world.get_session(session_id))

    async def list_sessions(self) -> list[SessionInfo]:
        """All sessions, oldest first; after a restart the sessions of the journal."""
        live = await self._live.ask(lambda world, _: world.list_sessions())
        sessions = live + self._lock_steps.infos()
        return sorted(sessions, key=lambda session: session.created_at)

    async def delete_session(self, session_id: str) -> None:
        """End a session, its agents and its streams. Raises NotFound."""
        home = self._lock_steps if self._lock_steps.session(session_id) else self._live
        async with self._gates.through(session_id):
            await home.delete_session(session_id)
        await self._persistence.durable(None)

    # Agents

    async def create_agents(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentInfo]:
        """All or none. Raises NotFound, InvalidArgument, ResourceExhausted."""
        home = self._lock_steps if self._lock_steps.session(session_id) else self._live
        async with self._gates.through(session_id):
            made = await home.create_agents(session_id, specs)
        return await self._persistence.durable(made)

    async def get_agent(self, agent_id: str) -> AgentInfo:
        """Raises NotFound."""
        return await self._home_of(agent_id).ask(lambda world, _: world.get_agent(agent_id))

    async def list_agents(self, session_id: str) -> list[AgentInfo]:
        """Raises NotFound."""
        return await self._home(session_id).ask(lambda world, _: world.list_agents(session_id))

    async def update_agent(self, agent_id: str, change: AgentChange) -> AgentInfo:
        """Raises NotFound, InvalidArgument."""
        async with self._gates.through(agent_id):
            changed = await self._home_of(agent_id).ask(
                lambda world, _: world.update_agent(agent_id, change)
            )
        return await self._persistence.durable(changed)

    async def delete_agent(self, agent_id: str) -> None:
        """Raises NotFound."""
        home = self._lock_steps if self._lock_steps.agent(agent_id) else self._live
        async with self._gates.through(agent_id):
            await home.delete_agent(agent_id)
        await self._persistence.durable(None)

    # Goals

    async def give(self, agent_id: str, command: GoalCommand, expected: int | None = None) -> int:
        """Give an agent a goal command; return the new goal revision.

        Raises NotFound, InvalidArgument that names the field, Aborted when the agent's revision is
        not `expected`; in a scene Unreachable when no way leads to a goal. A behaviour raises
        FailedPrecondition in a recorded session when it depends on other agents, and on a floor
        without end when it walks all over a scene.
        """
        try:
            async with self._gates.through(agent_id):
                revision = await self._home_of(agent_id).give(agent_id, command, expected)
        except Unreachable as error:
            raise await self.scenes.explained(error) from None
        return await self._persistence.durable(revision)

    # Motion

    async def subscribe(self, session_id: str, options: StreamOptions) -> Subscription:
        """Follow a session. Raises NotFound; FailedPrecondition for a lock-step session."""
        if self._lock_steps.session(session_id):
            raise FailedPrecondition(
                f"session {session_id!r} is in lock-step: its motion comes from StepAgents"
            )
        async with self._gates.through(session_id):
            return await self._live.subscribe(session_id, options)

    async def step_session(self, session_id: str, steps: int) -> list[Publication]:
        """Let primitives pass in a lock-step session. Raises NotFound, FailedPrecondition."""
        home = self._lock_steps.session(session_id)
        if home is None:
            await self._live.ask(lambda world, _: world.get_session(session_id))
            raise FailedPrecondition(
                f"session {session_id!r} runs in real time; create it with `lock_step` to step it"
            )
        async with self._gates.through(session_id):
            return await home.step(steps)

    def generate_clip(
        self, spec: AgentSpec, goals: Sequence[Goal], seconds: float, until_arrival: bool
    ) -> AsyncGenerator[Publication]:
        """Make a clip, off the real-time path. Raises InvalidArgument, ResourceExhausted."""
        return self._offline.run(
            lambda: walk(self._worlds.solo(), spec, goals, seconds, until_arrival)
        )

    def replay(self, log: bytes) -> AsyncGenerator[Publication]:
        """Make a log's motion again, off the real-time path. Raises InvalidArgument, …"""
        return self._offline.run(lambda: self._archive.replay(log))

    # Models

    async def list_models(self) -> list[ModelInfo]:
        """Those loaded, in order of loading."""
        return self._worlds.models.infos()

    async def load_model(self, name: str) -> None:
        """Load and warm a model beside others. Raises NotFound, AlreadyExists, ArtifactError."""
        await self._model_loader.load(name)

    async def use_model(self, name: str, move_agents: bool) -> int:
        """Moves new agents with it, and present ones too if asked; returns how many.

        Raises NotFound.
        """
        self._worlds.models.use(name)
        if not move_agents:
            return 0
        return await self._live.use_model(name) + await self._lock_steps.use_model(name)

    async def unload_model(self, name: str) -> None:
        """Raises NotFound, FailedPrecondition while it is in use."""
        self._worlds.models.remove(name)

    # Faults

    async def set_aside(self, session_id: str) -> None:
        """Take a session out that cannot go on, and keep what the disk has of it."""
        if self._lock_steps.session(session_id):
            await self.delete_session(session_id)
            return
        await self._live.ask(lambda *_: self._live.set_aside(session_id, "restore"))

    # Snapshots and logs

    async def export_session(self, session_id: str) -> bytes:
        """Its state as of the last frames sent. Raises NotFound."""
        return await self._archive.export_session(self._home(session_id), session_id)

    async def replica(self, session_id: str, mark: LogMark | None = UNCOPIED) -> Replica:
        """What it lives on from, with `adopt`, when this server has died; with its log since
        `mark`, that of the replica before, or without it. Raises NotFound.
        """
        if self.moves.is_lock_step(session_id):
            return await self.moves.replica(session_id, mark)
        return await self._archive.replica(self._home(session_id), session_id, mark)

    async def adopt(self, replica: bytes, log_parts: Sequence[bytes] = ()) -> SessionInfo:
        """Let a session live on from a replica's state, and its log from the parts of all.

        Also beyond `limits.sessions`, and where there is no time for its agents: elsewhere there is
        nobody to step them. All are then late, and degraded. Raises as `import_session`.
        """
        copy = await self.moves.read(replica)
        if copy.log is not None:
            return await self.moves.adopt(copy, log_parts)
        made = await self._go_on(copy.record, admit=False)
        if copy.crowd is not None:
            await self._live.put_crowd(made.session_id, copy.crowd)
        if log_parts:
            await self.moves.go_on_with_log(made.session_id, log_parts)
        return made

    async def import_session(
        self, snapshot: bytes, attributes: Mapping[str, str] | None = None
    ) -> SessionInfo:
        """Go on with an exported session; `attributes` go before those of the snapshot.

        Raises InvalidArgument, FailedPrecondition, AlreadyExists, ResourceExhausted.
        """
        record = await self._archive.read_session(snapshot, attributes or {})
        return await self._go_on(record, admit=True)

    async def export_log(self, session_id: str) -> bytes:
        """Commands of a recorded session. Raises NotFound, FailedPrecondition."""
        return await self._archive.export_log(self._home(session_id), session_id)

    # Within

    async def _go_on(self, record: SessionRecord, admit: bool) -> SessionInfo:
        scene = record.spec.scene
        async with self._gates.through(scene) if scene else nullcontext(), self._door:
            await self._refuse_taken(record.session_id)
            if record.spec.lock_step:
                made = await asyncio.to_thread(self._lock_steps.put, record, admit=admit)
            else:
                made = await self._live.put_session(record, admit)
            return await self._persistence.durable(made)

    def _home(self, session_id: str) -> LiveMotion | LockStep:
        return self._lock_steps.session(session_id) or self._live

    def _home_of(self, agent_id: str) -> LiveMotion | LockStep:
        return self._lock_steps.agent(agent_id) or self._live

    async def _create_session(self, spec: SessionSpec) -> SessionInfo:
        if spec.lock_step:
            return self._lock_steps.create(spec)
        return await self._live.create_session(spec)

    async def _refuse_taken(self, session_id: str) -> None:
        is_live = await self._live.ask(lambda world, _: session_id in world.registry.sessions)
        if is_live or self._lock_steps.session(session_id):
            raise AlreadyExists(f"session {session_id!r} exists already")

    def _wake(self, warm_up: Callable[[World], None]) -> None:
        """Warm up, then restore the journal. Runs on the motion thread, before its first turn; the
        page can be opened meanwhile.
        """
        prepare()
        warm_up(self._world)
        self._persistence.restore_scenes(self._worlds.scenes)
        self._persistence.restore(self._adopt, self._try_out)

    def _try_out(self, record: SessionRecord) -> None:
        """Step a session in a world apart."""
        world, now = self._worlds.apart(), self._clock()
        world.members.put_session(record, now, admit=False)
        try:
            for _ in world.advance(now + TRIAL_SECONDS):
                pass
        finally:
            world.delete_session(record.session_id)

    def _keep_aside(self, session_id: str) -> None:
        session = self._world.registry.session(session_id)
        self._persistence.set_aside(session_id, tuple(session.agents), session.spec.scene)

    def _adopt(self, record: SessionRecord) -> SessionInfo:
        if record.spec.lock_step:
            return self._lock_steps.put(record)
        return self._live.adopt(record, self._clock(), admit=False)
