"""The service that transports call: real time, lock-step, clips, snapshots, logs and the journal.

A call goes to the world of its session or agent. A call that changes something returns once the
journal, if it exists and can write, has the change on disk. The event loop may await all methods;
none blocks it.
"""

import asyncio
from collections.abc import AsyncGenerator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager, nullcontext
from dataclasses import replace
from typing import Final

from wayfarer.engines.engine import Engine
from wayfarer.engines.model_store import ModelLoader, no_model
from wayfarer.engines.models import ModelInfo
from wayfarer.errors import AlreadyExists, FailedPrecondition, Unreachable
from wayfarer.runtime.homes import Homes
from wayfarer.runtime.inbox import Inbox
from wayfarer.runtime.live import LiveMotion, steady_clock
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.move_locks import MoveLocks
from wayfarer.runtime.moving import LiveMoves, SceneMoves
from wayfarer.runtime.offline import Offline
from wayfarer.runtime.persistence.persistence import SAVE_PARTS, Persistence
from wayfarer.runtime.pipeline import EnginePipeline
from wayfarer.runtime.scenes import SceneService
from wayfarer.runtime.session_exports import SessionExports
from wayfarer.runtime.stats import LoopStats
from wayfarer.runtime.streams.publications import Publication, StreamOptions
from wayfarer.runtime.streams.publisher import Publisher
from wayfarer.runtime.streams.subscription import Subscription
from wayfarer.runtime.thread import MotionThread
from wayfarer.runtime.walk import walk
from wayfarer.runtime.world_factory import WorldFactory
from wayfarer.world.agents.agent import AgentChange, AgentInfo, AgentSpec, SessionInfo, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.records import SessionRecord
from wayfarer.world.goals.commands import Append, GoalCommand
from wayfarer.world.scenes.prepare import prepare
from wayfarer.world.world import World

INBOX: Final = 4096
"""Maximum number of commands that wait for the motion thread."""

TRIAL_SECONDS: Final = 1.0
"""Seconds for which a session is stepped when it is tried."""


class MotionService:
    """Sessions, agents, goals and streams. Scenes have a separate class."""

    def __init__(
        self,
        worlds: WorldFactory,
        warm_up: Callable[[World], None] = lambda world: None,
        clock: Callable[[], float] | None = None,
        meter: MetricsSink | None = None,
        open_model: Callable[[str], Engine] = no_model,
        may_step: Callable[[], bool] = lambda: True,
        ended: Callable[[], None] = lambda: None,
    ) -> None:
        """`warm_up` is called with the real-time world, on the motion thread before its first turn.
        `open_model(name)` opens another model, in a separate thread. `may_step`: see `Ownership`.
        `ended()` is called from another thread when the motion loop has failed for good, so that
        the process should end.

        The journal is read here, and its sessions resume once the thread is warm. Raises
        ArtifactError if they exceed the limits.
        """
        self._worlds = worlds
        self._exports = SessionExports(worlds)
        self._persistence = Persistence(worlds.journal, worlds.settings.limits, meter)
        self._clock = clock or steady_clock()
        self._offline = Offline(worlds.settings.limits.offline_jobs)
        self._model_loader = ModelLoader(worlds.models, open_model)
        self._move_locks = MoveLocks()
        self._entering = set[str]()  # ids of sessions that are being put into a world
        self._world = worlds.live()
        meter, inbox, world = meter or MetricsSink(), Inbox(INBOX), self._world
        self._thread = MotionThread(
            world=world,
            publisher=Publisher(world.settings.limits, meter, world.get_agent, world.faults),
            inbox=inbox,
            pipeline=EnginePipeline(self._clock, inbox.wake),
            warm_up=lambda: self._wake(warm_up),
            clock=self._clock,
            meter=meter,
            may_step=may_step,
            set_aside=lambda session_id: self._live.set_aside(session_id, "turn"),
            ended=ended,
        )
        self._live = LiveMotion(world, self._thread, meter, self._keep_aside)
        self._homes = Homes(self._live, worlds, self._offline, self._clock, meter)
        self.scenes = SceneService(
            registry=worlds.scenes,
            persistence=self._persistence,
            homes=self._homes,
            clock=self._clock,
            move_locks=self._move_locks,
        )
        self.moves = LiveMoves(
            worlds, self._exports, self._homes, self._persistence, self._move_locks
        )
        self.scene_moves = SceneMoves(self.scenes, self._persistence, self._move_locks)

    # Life

    def start(self) -> None:
        """Starts all threads, once; must be called on the event loop."""
        self._persistence.start(
            lambda: self._live.ask(lambda world, _: world.checkpoint(SAVE_PARTS))
        )
        self._live.start()

    async def stop(self) -> None:
        """Ends every thread, stream and waiting command; the present state is saved."""
        self._persistence.pause()
        await asyncio.to_thread(self._worlds.stop)
        await self._homes.stop()
        self.scenes.stop()
        self._world.checkpoint()
        await self._persistence.stop(in_good_order=not self._thread.failed)

    @property
    def ready(self) -> bool:
        """Whether models are loaded and warm and the loop is running."""
        return self._thread.ready

    @property
    def alive(self) -> bool:
        """Whether the loop has made a turn within the last second."""
        return self._thread.alive

    async def stats(self) -> LoopStats:
        """Figures for dashboards and the viewer."""
        stats = await self._live.ask(lambda *_: self._thread.stats())
        return replace(stats, journal_failing=self._persistence.failing)

    # Sessions

    async def create_session(self, spec: SessionSpec) -> SessionInfo:
        """Opens a session. Raises AlreadyExists, ResourceExhausted."""
        async with self._entered(spec.scene, spec.session_id):
            with self._homes.opening(spec) as home:
                made = await home.create_session(spec, self._clock())
            return await self._persistence.durable(made)

    async def get_session(self, session_id: str) -> SessionInfo:
        """Raises NotFound."""
        return await self._homes.of(session_id).ask(lambda world, _: world.get_session(session_id))

    async def list_sessions(self) -> list[SessionInfo]:
        """All sessions, oldest first; after a restart those of the journal."""
        return await self._homes.infos()

    async def delete_session(self, session_id: str) -> None:
        """Ends a session, its agents and its streams. Raises NotFound."""
        async with self._move_locks.through(session_id):
            await self._homes.delete_session(session_id)
        await self._persistence.durable(None)

    # Agents

    async def create_agents(
        self, session_id: str, specs: Sequence[AgentSpec], names: Sequence[str] = ()
    ) -> list[AgentInfo]:
        """Creates all or none, with these ids if they are given.

        Raises NotFound, InvalidArgument, ResourceExhausted.
        """
        async with self._move_locks.through(session_id):
            made = await self._homes.create_agents(session_id, specs, names)
        return await self._persistence.durable(made)

    async def get_agent(self, agent_id: str) -> AgentInfo:
        """Raises NotFound."""
        return await self._homes.of_agent(agent_id).ask(lambda world, _: world.get_agent(agent_id))

    async def list_agents(self, session_id: str) -> list[AgentInfo]:
        """Raises NotFound."""
        return await self._homes.of(session_id).ask(lambda world, _: world.list_agents(session_id))

    async def update_agent(self, agent_id: str, change: AgentChange) -> AgentInfo:
        """Raises NotFound, InvalidArgument."""
        async with self._move_locks.through(agent_id):
            changed = await self._homes.of_agent(agent_id).ask(
                lambda world, _: world.update_agent(agent_id, change)
            )
        return await self._persistence.durable(changed)

    async def delete_agent(self, agent_id: str) -> None:
        """Raises NotFound."""
        async with self._move_locks.through(agent_id):
            await self._homes.delete_agent(agent_id)
        await self._persistence.durable(None)

    # Goals

    async def give(self, agent_id: str, command: GoalCommand, expected: int | None = None) -> int:
        """Gives an agent a goal command; returns the new goal revision.

        Raises NotFound, InvalidArgument that names the field, Aborted if the agent's revision is
        not `expected`; in a scene Unreachable if no way leads to a goal. A behaviour raises
        FailedPrecondition in a recorded session if it depends on other agents, and on an endless
        floor if it walks all over a scene.
        """
        since = self._clock()

        def given(world: World, now: float) -> int:
            revision = world.give(agent_id, command, now, expected)
            if world is self._world and not isinstance(command, Append):  # those apply later
                self._live.await_goal(agent_id, revision, since)
            return revision

        try:
            async with self._move_locks.through(agent_id):
                revision = await self._homes.of_agent(agent_id).ask(given)
        except Unreachable as error:
            raise await self.scenes.work(error.explained) from None  # looks for obstacles
        return await self._persistence.durable(revision)

    # Motion

    async def subscribe(self, session_id: str, options: StreamOptions) -> Subscription:
        """Follows a session. Raises NotFound; FailedPrecondition for a lock-step session."""
        if self._homes.is_stepped(session_id):
            raise FailedPrecondition(
                f"session {session_id!r} is in lock-step: its motion comes from StepAgents"
            )
        async with self._move_locks.through(session_id):
            return await self._live.subscribe(session_id, options)

    async def step_session(self, session_id: str, steps: int) -> list[Publication]:
        """Advances a lock-step session by primitives. Raises NotFound, FailedPrecondition."""
        if not self._homes.is_stepped(session_id):
            await self._live.ask(lambda world, _: world.get_session(session_id))
            raise FailedPrecondition(
                f"session {session_id!r} runs in real time; create it with `lock_step` to step it"
            )
        async with self._move_locks.through(session_id):
            return await self._homes.step(session_id, steps)

    def generate_clip(
        self, spec: AgentSpec, goals: Sequence[Goal], seconds: float, until_arrival: bool
    ) -> AsyncGenerator[Publication]:
        """Makes a clip, off the real-time path. Raises InvalidArgument, ResourceExhausted."""
        return self._offline.run(
            lambda: walk(self._worlds.solo(), spec, goals, seconds, until_arrival)
        )

    def replay(self, log: bytes) -> AsyncGenerator[Publication]:
        """Makes a log's motion again, off the real-time path. Raises as `import_session`."""
        return self._offline.run(lambda: self._exports.replay(log))

    # Models

    async def list_models(self) -> list[ModelInfo]:
        """The loaded models, in order of loading."""
        return self._worlds.models.infos()

    async def load_model(self, name: str) -> None:
        """Loads and warms another model. Raises NotFound, AlreadyExists, ArtifactError."""
        await self._model_loader.load(name)

    async def use_model(self, name: str, move_agents: bool) -> int:
        """Uses a model for new agents, and for present ones if asked; returns how many changed.

        Raises NotFound.
        """
        self._worlds.models.use(name)
        if not move_agents:
            return 0
        return await self._homes.use_model(name)

    async def unload_model(self, name: str) -> None:
        """Raises NotFound, FailedPrecondition while it is in use."""
        self._worlds.models.remove(name)

    # Faults

    async def set_aside(self, session_id: str) -> None:
        """Removes a session that cannot continue, and keeps its data on disk."""
        if self._homes.is_stepped(session_id):
            await self.delete_session(session_id)
            return
        await self._live.ask(lambda *_: self._live.set_aside(session_id, "restore"))

    # Snapshots and logs

    async def export_session(self, session_id: str) -> bytes:
        """Its state as of the last frames sent. Raises NotFound."""
        return await self._exports.export_session(self._homes.of(session_id), session_id)

    async def import_session(
        self, snapshot: bytes, attributes: Mapping[str, str] | None = None
    ) -> SessionInfo:
        """Resumes an exported session; `attributes` take precedence over the snapshot's.

        Raises InvalidArgument, FailedPrecondition, AlreadyExists, ResourceExhausted.
        """
        record = await self._exports.read_session(snapshot, attributes or {})
        async with self._entered(record.spec.scene, record.session_id):
            with self._homes.opening(record.spec, record) as home:
                made = await home.put_session(record)
            return await self._persistence.durable(made)

    async def export_log(self, session_id: str) -> bytes:
        """The commands of a recorded session. Raises NotFound, FailedPrecondition."""
        return await self._exports.export_log(self._homes.of(session_id), session_id)

    # Private

    @asynccontextmanager
    async def _entered(self, scene: str, session_id: str | None) -> AsyncGenerator[None]:
        """A session is put into a world meanwhile: two of one id must not enter different worlds.
        `session_id`: None where it gets a new one. Raises AlreadyExists.
        """
        async with self._move_locks.through(scene) if scene else nullcontext():
            if session_id is None:
                yield
                return
            taken = AlreadyExists(f"session {session_id!r} exists already")
            if session_id in self._entering or self._homes.is_stepped(session_id):
                raise taken
            self._entering.add(session_id)
            try:
                if await self._live.ask(lambda w, _: session_id in w.registry.sessions):
                    raise taken
                yield
            finally:
                self._entering.remove(session_id)

    def _wake(self, warm_up: Callable[[World], None]) -> None:
        """Warms up, then restores the journal. Runs on the motion thread, before its first turn;
        the page can be opened meanwhile.
        """
        prepare()
        warm_up(self._world)
        self._persistence.restore_scenes(self._worlds.scenes)
        self._persistence.restore(self._adopt, self._try_out)

    def _try_out(self, record: SessionRecord) -> None:
        """Steps a session in a separate world."""
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
        with self._homes.opening(record.spec, record) as home:
            return home.adopt(record, admit=False)
