"""The runtime whole: real time, lock-step, clips, snapshots, logs and the journal. The one
`MotionService` that transports see.

A call goes to the world in which its session or agent lives. What changes something returns once
the journal, if there is one, has it on disk.
"""

import asyncio
from collections.abc import AsyncGenerator, Callable, Mapping, Sequence
from dataclasses import replace

from wayfarer.engines.engine import Engine
from wayfarer.engines.model_store import ModelLoader, no_model
from wayfarer.engines.models import ModelInfo
from wayfarer.errors import AlreadyExists, FailedPrecondition
from wayfarer.service.archive import Archive
from wayfarer.service.live import LiveMotion, steady_clock
from wayfarer.service.lockstep import LockStep, LockSteps
from wayfarer.service.metrics_sink import MetricsSink
from wayfarer.service.offline import Offline
from wayfarer.service.persistence.persistence import SAVE_PARTS, Persistence
from wayfarer.service.scenes import Scenes
from wayfarer.service.stats import LoopStats
from wayfarer.service.streams.publications import Publication, StreamOptions
from wayfarer.service.streams.subscription import BoundedSubscription
from wayfarer.service.walk import walk
from wayfarer.service.worlds import Worlds
from wayfarer.world.agents.agent import (
    AgentChange,
    AgentInfo,
    AgentSpec,
    Goal,
    SessionInfo,
    SessionSpec,
)
from wayfarer.world.agents.records import SessionRecord
from wayfarer.world.goals.commands import GoalCommand
from wayfarer.world.world import World


class Runtime:
    """Implements `MotionService`."""

    def __init__(
        self,
        worlds: Worlds,
        warm_up: Callable[[World], None] = lambda world: None,
        clock: Callable[[], float] | None = None,
        meter: MetricsSink | None = None,
        open_model: Callable[[str], Engine] = no_model,
    ) -> None:
        """`warm_up` is called with the world in real time, on the motion thread before its first
        turn. `open_model(name)` opens one more model, in a thread of its own.

        What the journal holds is read here and goes on once the thread is warm. Raises
        ArtifactError when that is more than the limits allow.
        """
        self._worlds = worlds
        self._archive = Archive(worlds)
        self._persistence = Persistence(worlds.journal, worlds.settings.limits)
        self._clock = clock or steady_clock()
        self._offline = Offline(worlds.settings.limits.offline_jobs)
        self._model_loader = ModelLoader(worlds.models, open_model)
        self._door = asyncio.Lock()  # two sessions of one id must not enter different worlds
        self._world = worlds.live()
        self._live = LiveMotion(self._world, lambda: self._wake(warm_up), self._clock, meter)
        self._lock_steps = LockSteps(worlds, self._offline, self._clock)
        self.scenes = Scenes(
            book=worlds.scenes,
            persistence=self._persistence,
            live=self._live,
            lock_steps=self._lock_steps,
            clock=self._clock,
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
        await self._persistence.stop()

    @property
    def ready(self) -> bool:
        """See `MotionService`."""
        return self._live.ready

    @property
    def alive(self) -> bool:
        """See `MotionService`."""
        return self._live.alive

    async def stats(self) -> LoopStats:
        """See `MotionService`."""
        return replace(await self._live.stats(), journal_failing=self._persistence.failing)

    # Sessions

    async def create_session(self, spec: SessionSpec) -> SessionInfo:
        """See `MotionService`."""
        if spec.session_id is None:  # it gets an id of its own: nobody needs to wait at the door
            made = await self._create_session(spec)
        else:
            async with self._door:
                await self._refuse_taken(spec.session_id)
                made = await self._create_session(spec)
        return await self._persistence.durable(made)

    async def get_session(self, session_id: str) -> SessionInfo:
        """See `MotionService`."""
        return await self._home(session_id).get_session(session_id)

    async def list_sessions(self) -> list[SessionInfo]:
        """See `MotionService`."""
        sessions = await self._live.list_sessions() + self._lock_steps.infos()
        return sorted(sessions, key=lambda session: session.created_at)

    async def delete_session(self, session_id: str) -> None:
        """See `MotionService`."""
        home = self._lock_steps if self._lock_steps.session(session_id) else self._live
        await home.delete_session(session_id)
        await self._persistence.durable(None)

    # Agents

    async def create_agents(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentInfo]:
        """See `MotionService`."""
        home = self._lock_steps if self._lock_steps.session(session_id) else self._live
        return await self._persistence.durable(await home.create_agents(session_id, specs))

    async def get_agent(self, agent_id: str) -> AgentInfo:
        """See `MotionService`."""
        return await self._home_of(agent_id).get_agent(agent_id)

    async def list_agents(self, session_id: str) -> list[AgentInfo]:
        """See `MotionService`."""
        return await self._home(session_id).list_agents(session_id)

    async def update_agent(self, agent_id: str, change: AgentChange) -> AgentInfo:
        """See `MotionService`."""
        changed = await self._home_of(agent_id).update_agent(agent_id, change)
        return await self._persistence.durable(changed)

    async def delete_agent(self, agent_id: str) -> None:
        """See `MotionService`."""
        home = self._lock_steps if self._lock_steps.agent(agent_id) else self._live
        await home.delete_agent(agent_id)
        await self._persistence.durable(None)

    # Goals

    async def give(self, agent_id: str, command: GoalCommand, expected: int | None = None) -> int:
        """See `MotionService`."""
        return await self._persistence.durable(
            await self._home_of(agent_id).give(agent_id, command, expected)
        )

    # Motion

    async def subscribe(self, session_id: str, wish: StreamOptions) -> BoundedSubscription:
        """See `MotionService`."""
        if self._lock_steps.session(session_id):
            raise FailedPrecondition(
                f"session {session_id!r} is in lock-step: its motion comes from StepAgents"
            )
        return await self._live.subscribe(session_id, wish)

    async def step_session(self, session_id: str, steps: int) -> list[Publication]:
        """See `MotionService`."""
        home = self._lock_steps.session(session_id)
        if home is None:
            await self._live.get_session(session_id)
            raise FailedPrecondition(
                f"session {session_id!r} goes with time by itself; create it with `lock_step` to "
                "step it"
            )
        return await home.step(steps)

    def generate_clip(
        self, spec: AgentSpec, goals: Sequence[Goal], seconds: float, until_arrival: bool
    ) -> AsyncGenerator[Publication]:
        """See `MotionService`."""
        return self._offline.run(
            lambda: walk(self._worlds.solo(), spec, goals, seconds, until_arrival)
        )

    def replay(self, log: bytes) -> AsyncGenerator[Publication]:
        """See `MotionService`."""
        return self._offline.run(lambda: self._archive.replay(log))

    # Models

    async def list_models(self) -> list[ModelInfo]:
        """See `MotionService`."""
        return self._worlds.models.infos()

    async def load_model(self, name: str) -> None:
        """See `MotionService`."""
        await self._model_loader.load(name)

    async def use_model(self, name: str, move_agents: bool) -> int:
        """See `MotionService`."""
        self._worlds.models.use(name)
        if not move_agents:
            return 0
        return await self._live.use_model(name) + await self._lock_steps.use_model(name)

    async def unload_model(self, name: str) -> None:
        """See `MotionService`."""
        self._worlds.models.remove(name)

    # Snapshots and logs

    async def export_session(self, session_id: str) -> bytes:
        """See `MotionService`."""
        return await self._archive.export_session(self._home(session_id), session_id)

    async def import_session(
        self, snapshot: bytes, attributes: Mapping[str, str] | None = None
    ) -> SessionInfo:
        """See `MotionService`."""
        record = await self._archive.read_session(snapshot, attributes or {})
        async with self._door:
            await self._refuse_taken(record.session_id)
            if record.spec.lock_step:
                made = await asyncio.to_thread(self._lock_steps.put, record)
            else:
                made = await self._live.put_session(record)
        return await self._persistence.durable(made)

    async def export_log(self, session_id: str) -> bytes:
        """See `MotionService`."""
        return await self._archive.export_log(self._home(session_id), session_id)

    # Within

    def _home(self, session_id: str) -> LiveMotion | LockStep:
        return self._lock_steps.session(session_id) or self._live

    def _home_of(self, agent_id: str) -> LiveMotion | LockStep:
        return self._lock_steps.agent(agent_id) or self._live

    async def _create_session(self, spec: SessionSpec) -> SessionInfo:
        if spec.lock_step:
            return self._lock_steps.create(spec)
        return await self._live.create_session(spec)

    async def _refuse_taken(self, session_id: str) -> None:
        if self._lock_steps.session(session_id) or any(
            session.session_id == session_id for session in await self._live.list_sessions()
        ):
            raise AlreadyExists(f"session {session_id!r} exists already")

    def _wake(self, warm_up: Callable[[World], None]) -> None:
        """On the motion thread, before its first turn: warm up, then go on with what was kept."""
        warm_up(self._world)
        self._persistence.restore_scenes(self._worlds.scenes)
        self._persistence.restore(self._adopt)

    def _adopt(self, record: SessionRecord) -> SessionInfo:
        if record.spec.lock_step:
            return self._lock_steps.put(record)
        return self._live.adopt(record, self._clock(), admit=False)
