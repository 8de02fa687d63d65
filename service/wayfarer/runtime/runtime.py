"""The runtime whole: real time, lock-step, clips, snapshots, logs and the journal. The one
`MotionService` that transports see.

A call goes to the world in which its session or agent lives. What changes something returns once
the journal, if there is one, has it on disk.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final, TypeVar

import structlog

from wayfarer.errors import (
    AlreadyExists,
    ArtifactError,
    FailedPrecondition,
    Unavailable,
    WayfarerError,
)
from wayfarer.runtime.agent import (
    AgentChange,
    AgentInfo,
    AgentSpec,
    Goal,
    LoopStats,
    ModelInfo,
    Publication,
    SessionInfo,
    SessionSpec,
    StreamWish,
    Wander,
)
from wayfarer.runtime.commands import AppendGoals, ClearGoal, Order, SetGoal, SetPath
from wayfarer.runtime.engine import Engine
from wayfarer.runtime.handover import SessionRecord
from wayfarer.runtime.kept import KeptWorld
from wayfarer.runtime.lockstep import LockStep, LockSteps
from wayfarer.runtime.log_format import Origin, decode_log, encode_log
from wayfarer.runtime.loop import LoopSettings, MotionLoop, steady_clock
from wayfarer.runtime.meter import Meter
from wayfarer.runtime.model_store import ModelDesk, no_model
from wayfarer.runtime.offline import Offline
from wayfarer.runtime.replay import replay
from wayfarer.runtime.snapshot import decode_session, encode_session
from wayfarer.runtime.subscription import BoundedSubscription
from wayfarer.runtime.walk import walk
from wayfarer.runtime.worlds import Worlds

log = structlog.get_logger(__name__)

T = TypeVar("T")

SAVE_SECONDS: Final = 0.4
"""Between two copies of where everybody stands, for the journal."""

SETTLE_TRIES: Final = 15
SETTLE_SECONDS: Final = 0.02
"""An export waits so often, so long, for chunks that were planned before an order to be sent: they
leave within 0.1 s of it."""


class Runtime:
    """Implements `MotionService`."""

    def __init__(
        self,
        worlds: Worlds,
        jobs: int = 2,
        warm_up: Callable[[KeptWorld], None] = lambda world: None,
        settings: LoopSettings | None = None,
        clock: Callable[[], float] | None = None,
        meter: Meter | None = None,
        open_model: Callable[[str], Engine] = no_model,
    ) -> None:
        """`warm_up` is called with the world in real time, on the motion thread before its first
        turn; up to `jobs` clips, replays and lock-step calls are made at a time. `open_model(name)`
        opens one more model, in a thread of its own.

        What the journal holds is read here and goes on once the thread is warm. Raises
        ArtifactError when that is more than the limits allow.
        """
        self._worlds = worlds
        self._limits = worlds.settings.limits
        self._journal = worlds.journal
        self._clock = clock or steady_clock()
        self._offline = Offline(jobs)
        self._desk = ModelDesk(worlds.models, open_model)
        self._lock_steps = LockSteps(worlds, self._offline, self._clock)
        self._door = asyncio.Lock()  # two sessions of one id must not enter different worlds
        self._saving: asyncio.Task[None] | None = None
        self._kept = self._read_journal()
        self._world = worlds.live()
        self._loop = MotionLoop(
            self._world, lambda: self._wake(warm_up), settings, self._clock, meter
        )

    # Life

    def start(self) -> None:
        """Start all threads, once; to be called on the event loop."""
        if self._journal is not None:
            self._journal.start()
            self._saving = asyncio.create_task(self._save())
        self._loop.start()

    async def stop(self) -> None:
        """End every thread, stream and waiting command; where all stand is saved."""
        reason = "the server has been stopped"
        if self._saving is not None:
            self._saving.cancel()
        await self._loop.stop()
        await asyncio.to_thread(self._lock_steps.stop, reason)
        if self._journal is not None:
            self._world.save()
            await asyncio.to_thread(self._journal.stop)

    @property
    def ready(self) -> bool:
        """See `MotionService`, as for all below."""
        return self._loop.ready

    @property
    def alive(self) -> bool:
        """See `MotionService`."""
        return self._loop.alive

    async def stats(self) -> LoopStats:
        """See `MotionService`."""
        failing = self._journal is not None and self._journal.failing
        return replace(await self._loop.stats(), journal_failing=failing)

    # Sessions

    async def create_session(self, spec: SessionSpec) -> SessionInfo:
        """See `MotionService`."""
        async with self._door:
            await self._refuse_taken(spec.session_id)
            if spec.lock_step:
                made = self._lock_steps.create(spec)
            else:
                made = await self._loop.create_session(spec)
        return await self._durable(made)

    async def get_session(self, session_id: str) -> SessionInfo:
        """See `MotionService`."""
        return await self._home(session_id).get_session(session_id)

    async def list_sessions(self) -> list[SessionInfo]:
        """See `MotionService`."""
        sessions = await self._loop.list_sessions() + await self._lock_steps.infos()
        return sorted(sessions, key=lambda session: session.created_at)

    async def delete_session(self, session_id: str) -> None:
        """See `MotionService`."""
        home = self._lock_steps if self._lock_steps.session(session_id) else self._loop
        await home.delete_session(session_id)
        await self._durable(None)

    # Agents

    async def create_agents(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentInfo]:
        """See `MotionService`."""
        home = self._lock_steps if self._lock_steps.session(session_id) else self._loop
        return await self._durable(await home.create_agents(session_id, specs))

    async def get_agent(self, agent_id: str) -> AgentInfo:
        """See `MotionService`."""
        return await self._home_of(agent_id).get_agent(agent_id)

    async def list_agents(self, session_id: str) -> list[AgentInfo]:
        """See `MotionService`."""
        return await self._home(session_id).list_agents(session_id)

    async def update_agent(self, agent_id: str, change: AgentChange) -> AgentInfo:
        """See `MotionService`."""
        return await self._durable(await self._home_of(agent_id).update_agent(agent_id, change))

    async def delete_agent(self, agent_id: str) -> None:
        """See `MotionService`."""
        home = self._lock_steps if self._lock_steps.agent(agent_id) else self._loop
        await home.delete_agent(agent_id)
        await self._durable(None)

    # Goals

    async def set_goal(self, agent_id: str, goal: Goal, expected: int | None = None) -> int:
        """See `MotionService`."""
        return await self._give(agent_id, SetGoal(goal), expected)

    async def set_path(
        self, agent_id: str, goals: Sequence[Goal], expected: int | None = None
    ) -> int:
        """See `MotionService`."""
        return await self._give(agent_id, SetPath(tuple(goals)), expected)

    async def append_goals(
        self, agent_id: str, goals: Sequence[Goal], expected: int | None = None
    ) -> int:
        """See `MotionService`."""
        return await self._give(agent_id, AppendGoals(tuple(goals)), expected)

    async def wander(self, agent_id: str, area: Wander, expected: int | None = None) -> int:
        """See `MotionService`."""
        return await self._give(agent_id, area, expected)

    async def clear_goal(self, agent_id: str, expected: int | None = None) -> int:
        """See `MotionService`."""
        return await self._give(agent_id, ClearGoal(), expected)

    # Motion

    async def subscribe(self, session_id: str, wish: StreamWish) -> BoundedSubscription:
        """See `MotionService`."""
        if self._lock_steps.session(session_id):
            raise FailedPrecondition(
                f"session {session_id!r} is in lock-step: its motion comes from StepAgents"
            )
        return await self._loop.subscribe(session_id, wish)

    async def step_session(self, session_id: str, steps: int) -> list[Publication]:
        """See `MotionService`."""
        home = self._lock_steps.session(session_id)
        if home is None:
            await self._loop.get_session(session_id)
            raise FailedPrecondition(
                f"session {session_id!r} goes with time by itself; create it with `lock_step` to "
                "step it"
            )
        return await home.step(steps)

    def generate_clip(
        self, spec: AgentSpec, goals: Sequence[Goal], seconds: float, until_arrival: bool
    ) -> AsyncIterator[Publication]:
        """See `MotionService`."""
        return self._offline.run(
            lambda: walk(self._worlds.solo(), spec, goals, seconds, until_arrival)
        )

    def replay(self, log: bytes) -> AsyncIterator[Publication]:
        """See `MotionService`."""

        def play() -> Iterator[Publication]:
            entries = self._worlds.log_entries
            commands = decode_log(log, self._origin, self._limits, entries)
            return replay(commands, self._worlds.solo)

        return self._offline.run(play)

    # Models

    async def list_models(self) -> list[ModelInfo]:
        """See `MotionService`."""
        return self._worlds.models.infos()

    async def load_model(self, name: str) -> None:
        """See `MotionService`."""
        await self._desk.load(name)

    async def use_model(self, name: str, move_agents: bool) -> int:
        """See `MotionService`."""
        self._worlds.models.use(name)
        if not move_agents:
            return 0
        return await self._loop.use_model(name) + await self._lock_steps.use_model(name)

    async def unload_model(self, name: str) -> None:
        """See `MotionService`."""
        self._worlds.models.remove(name)

    # Snapshots and logs

    async def export_session(self, session_id: str) -> bytes:
        """See `MotionService`."""
        home = self._home(session_id)
        for _ in range(SETTLE_TRIES):
            if await home.ask(lambda world, _: _kept(world).is_settled(session_id)):
                break
            await asyncio.sleep(SETTLE_SECONDS)
        session, crowd = await home.ask(lambda world, _: _kept(world).capture(session_id))
        parts = [member.part for member in crowd.members]
        body = self._worlds.body
        return await asyncio.to_thread(encode_session, session, parts, crowd.rows, body)

    async def import_session(
        self, snapshot: bytes, attributes: Mapping[str, str] | None = None
    ) -> SessionInfo:
        """See `MotionService`."""
        body = self._worlds.body
        record = await asyncio.to_thread(decode_session, snapshot, body, self._limits)
        own = {**record.spec.attributes, **(attributes or {})}
        record = replace(record, spec=replace(record.spec, attributes=own))
        async with self._door:
            await self._refuse_taken(record.session_id)
            if record.spec.lock_step:
                made = self._lock_steps.put(record)
            else:
                made = await self._loop.put_session(record)
        return await self._durable(made)

    async def export_log(self, session_id: str) -> bytes:
        """See `MotionService`."""
        home = self._home(session_id)
        commands = await home.ask(lambda world, _: _kept(world).log(session_id))
        return await asyncio.to_thread(encode_log, commands, self._origin)

    # Within

    @property
    def _origin(self) -> Origin:
        steering = self._worlds.settings.steering
        wished = max(search.candidates for search in steering.searches.values())
        return Origin(self._worlds.body, self._worlds.models.stamps, wished)

    def _home(self, session_id: str) -> MotionLoop | LockStep:
        return self._lock_steps.session(session_id) or self._loop

    def _home_of(self, agent_id: str) -> MotionLoop | LockStep:
        return self._lock_steps.agent(agent_id) or self._loop

    async def _give(self, agent_id: str, order: Order, expected: int | None) -> int:
        return await self._durable(await self._home_of(agent_id).give(agent_id, order, expected))

    async def _durable(self, result: T) -> T:
        """Hand on what a change returned, once it cannot be lost any more."""
        if self._journal is not None:
            await self._journal.durable()
        return result

    async def _refuse_taken(self, session_id: str | None) -> None:
        if session_id is not None and (
            self._lock_steps.session(session_id)
            or any(s.session_id == session_id for s in await self._loop.list_sessions())
        ):
            raise AlreadyExists(f"session {session_id!r} exists already")

    # The journal

    def _read_journal(self) -> list[SessionRecord]:
        """Raises ArtifactError when there is more in it than may be here."""
        if self._journal is None:
            return []
        records = self._journal.restore(self._limits)
        agents, limits = sum(len(record.agents) for record in records), self._limits
        if len(records) > limits.sessions or agents > limits.agents:
            raise ArtifactError(
                f"the journal holds {len(records)} sessions with {agents} agents; limits.sessions "
                f"is {limits.sessions} and limits.agents {limits.agents}: raise them, or take "
                "another state_dir"
            )
        return records

    def _wake(self, warm_up: Callable[[KeptWorld], None]) -> None:
        """On the motion thread, before its first turn: warm up, then go on with what was kept."""
        warm_up(self._world)
        for record in self._kept:
            try:
                if record.spec.lock_step:
                    self._lock_steps.put(record)
                else:
                    self._loop.adopt(record, self._clock(), admit=False)
            except WayfarerError as error:
                log.error(
                    "a session of the journal does not fit in here; it is left in the journal",
                    session=record.session_id,
                    why=str(error),
                )
        if self._kept:
            agents = sum(len(record.agents) for record in self._kept)
            log.info("the journal was read", sessions=len(self._kept), agents=agents)
        self._kept = []

    async def _save(self) -> None:
        while True:
            await asyncio.sleep(SAVE_SECONDS)
            with contextlib.suppress(Unavailable):  # it is warming up, or flooded
                await self._loop.ask(lambda world, _: _kept(world).save())


def _kept(world: object) -> KeptWorld:
    assert isinstance(world, KeptWorld)  # the loop has it from us
    return world
