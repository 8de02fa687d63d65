"""Where sessions live: in the world in real time, or each in a world of its own, in lock-step.

A world in lock-step has a thread and a bounded inbox, so a session that steps for long delays only
its own callers.
"""

import asyncio
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress

from wayfarer.errors import AlreadyExists, NotFound, ResourceExhausted, WayfarerError
from wayfarer.runtime.live import LiveMotion
from wayfarer.runtime.lockstep import LockStepThread, ManualClock
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.offline import Offline
from wayfarer.runtime.streams.publications import Publication
from wayfarer.runtime.streams.publisher import SessionLog
from wayfarer.runtime.world_factory import WorldFactory
from wayfarer.world.agents.agent import AgentInfo, AgentSpec, SessionInfo, SessionSpec
from wayfarer.world.agents.records import SessionRecord


class Homes:
    """The homes of all sessions, by their ids and those of their agents. Thread-safe."""

    def __init__(
        self,
        live: LiveMotion,
        worlds: WorldFactory,
        offline: Offline,
        clock: Callable[[], float],
        meter: MetricsSink | None = None,
    ) -> None:
        self.live = live
        self._worlds = worlds
        self._limits = worlds.settings.limits
        self._offline = offline
        self._clock = clock
        self._meter = meter or MetricsSink()
        self._spawn_pool = ThreadPoolExecutor(1, "spawn")
        # in lock-step
        self._sessions: dict[str, tuple[LiveMotion, LockStepThread]] = {}
        self._agents: dict[str, LiveMotion] = {}
        self._new_sessions = self._new_agents = 0  # being made, and not yet in the dicts
        self._lock = threading.Lock()  # for changes: other threads put sessions in, too

    def of(self, session_id: str) -> LiveMotion:
        """The home of a session; the real-time one if there is no such session."""
        return self._sessions[session_id][0] if self.is_stepped(session_id) else self.live

    def of_agent(self, agent_id: str) -> LiveMotion:
        """The home of an agent; the real-time one if there is no such agent."""
        return self._agents.get(agent_id, self.live)

    def is_stepped(self, session_id: str) -> bool:
        """Whether a session is in lock-step."""
        return session_id in self._sessions

    async def step(self, session_id: str, steps: int) -> list[Publication]:
        """See `LockStepThread`."""
        return await self._sessions[session_id][1].step(session_id, steps)

    @contextmanager
    def opening(
        self,
        spec: SessionSpec,
        record: SessionRecord | None = None,
        log: SessionLog | None = None,
        admit: bool = True,
    ) -> Iterator[LiveMotion]:
        """A home for a session, which the caller puts in: a new one, or that of a record.

        `log` is the progress of a session that moves. Without `admit`, one in lock-step comes also
        beyond `limits.sessions`. Raises AlreadyExists, ResourceExhausted.
        """
        if not spec.lock_step:
            yield self.live
            return
        if record is not None and self.is_stepped(record.session_id):
            raise AlreadyExists(f"session {record.session_id!r} exists already")
        clock = ManualClock(self._clock())
        if log is not None and log.last_at is not None:
            clock = ManualClock(log.last_at - log.motion, log.motion)
        with self._room(int(admit), 0 if record is None else len(record.agents)):
            world = self._worlds.lock_step()
            thread = LockStepThread(world, self._offline, clock, self._meter)
            home = LiveMotion(world, thread, self._meter, spawn_pool=self._spawn_pool)
            home.start()
            try:
                yield home
            except BaseException:
                thread.end("the session could not be opened")
                raise
            with self._lock:
                for session in world.list_sessions():
                    self._sessions[session.session_id] = home, thread
                    self._agents |= dict.fromkeys(session.agent_ids, home)

    async def create_agents(
        self, session_id: str, specs: Sequence[AgentSpec], names: Sequence[str] = ()
    ) -> list[AgentInfo]:
        """See `MotionService`."""
        home = self.of(session_id)
        if home is self.live:
            return await home.create_agents(session_id, specs, names)
        with self._room(0, len(specs)):
            agents = await home.create_agents(session_id, specs, names)
            with self._lock:
                self._agents.update((agent.agent_id, home) for agent in agents)
        return agents

    async def delete_agent(self, agent_id: str) -> None:
        """Deletes an agent."""
        await self.of_agent(agent_id).delete_agent(agent_id)
        with self._lock:
            self._agents.pop(agent_id, None)

    async def delete_session(self, session_id: str, error: WayfarerError | None = None) -> None:
        """See `LiveMotion`; a session in lock-step ends with its thread."""
        home, thread = self._sessions.get(session_id, (self.live, None))
        await home.delete_session(session_id, error)
        if thread is None:
            return
        with self._lock:
            self._sessions.pop(session_id, None)
            left = {name: other for name, other in self._agents.items() if other is not home}
            self._agents = left
        thread.end(f"session {session_id!r} has been deleted", NotFound)

    async def infos(self) -> list[SessionInfo]:
        """All sessions, oldest first. A busy world in lock-step is read instead of asked: only
        whole values, and only the names of agents.
        """
        found = await self.live.ask(lambda world, _: world.list_sessions())
        for name, (_, thread) in list(self._sessions.items()):
            with suppress(NotFound):  # deleted meanwhile
                found.append(thread.world.get_session(name))
        return sorted(found, key=lambda session: session.created_at)

    async def use_model(self, name: str) -> int:
        """Uses a model in all of them; see `LiveMotion.use_model`."""
        moved = await self.live.use_model(name)
        for home, _ in list(self._sessions.values()):
            with suppress(NotFound):  # deleted meanwhile
                moved += await home.use_model(name)
        return moved

    async def stop(self) -> None:
        """Ends all of them."""
        await self.live.stop()
        threads = [thread for _, thread in self._sessions.values()]
        await asyncio.gather(*(thread.stop() for thread in threads))
        self._spawn_pool.shutdown(wait=False, cancel_futures=True)

    @contextmanager
    def _room(self, sessions: int, agents: int) -> Iterator[None]:
        """Reserves room in lock-step while agents are made. Raises ResourceExhausted."""
        limits = self._limits
        with self._lock:
            if sessions and len(self._sessions) + self._new_sessions >= limits.sessions:
                raise ResourceExhausted(
                    f"all {limits.sessions} sessions in lock-step are open; delete one first"
                )
            present = len(self._agents) + self._new_agents
            if present + agents > limits.agents:
                raise ResourceExhausted(
                    f"{present} of {limits.agents} agents in lock-step exist; "
                    f"{agents} more were asked for"
                )
            self._new_sessions += sessions
            self._new_agents += agents
        try:
            yield
        finally:
            with self._lock:
                self._new_sessions -= sessions
                self._new_agents -= agents
