"""Sessions in lock-step: each has its own world, in which time passes only on request.

A world has a thread and a bounded inbox, so a session that steps for long delays only its own
callers.
"""

import asyncio
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import replace
from math import floor
from typing import Final

from wayfarer.errors import AlreadyExists, NotFound, ResourceExhausted, Unavailable, WayfarerError
from wayfarer.runtime.inbox import Inbox
from wayfarer.runtime.live import LiveMotion
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.offline import Offline
from wayfarer.runtime.streams.publications import Publication
from wayfarer.runtime.streams.publisher import Publisher, SessionLog
from wayfarer.runtime.worlds import Worlds
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import (
    NO_CHUNKS,
    AgentInfo,
    AgentSpec,
    MotionChunks,
    SessionInfo,
)
from wayfarer.world.events import Event
from wayfarer.world.world import World

INBOX: Final = 256
"""Maximum number of commands that wait in one session."""

WAIT: Final = 60.0
"""Seconds between checks whether an unused session still exists."""

HAIR: Final = 2e-4
"""Seconds before the next primitive at which calls see the world, so new agents start with it."""


class ManualClock:
    """Unix seconds that pass by primitives."""

    def __init__(self, started_at: float, seconds: float = 0.0) -> None:
        """`seconds` have passed since `started_at`."""
        self._started_at = floor(started_at / STEP_SECONDS) * STEP_SECONDS  # like agents' steps
        self._steps = round(seconds / STEP_SECONDS)

    def __call__(self) -> float:
        """Now, as calls see it."""
        return self.next - HAIR

    @property
    def next(self) -> float:
        """When the next primitive begins."""
        return self._started_at + self.seconds

    @property
    def seconds(self) -> float:
        """Since the start of the session."""
        return self._steps * STEP_SECONDS

    def advance(self) -> None:
        """Lets a primitive pass."""
        self._steps += 1


class LockStepPublisher(Publisher):
    """Gathers what happens in a primitive. Times count from the start of the session."""

    def __init__(self, world: World, clock: ManualClock, meter: MetricsSink) -> None:
        super().__init__(world.settings.limits, meter, world.get_agent, world.faults)
        self._clock = clock
        self._told: list[Event] = []

    def tell(self, session_id: str, events: Sequence[Event]) -> None:
        """Keeps these for the next publication."""
        self._told += [replace(event, at=self._clock.seconds) for event in events]

    def gather(self, session_id: str, chunks: MotionChunks, met: Sequence[Event]) -> Publication:
        """The publication of a primitive that has passed; `met` on the agents' ways."""
        at, log = self._clock.seconds, self._log(session_id)
        chunks.scheduled_at[:] = at
        log.position += 1
        events = (
            *log.goal_events.events(chunks),
            *(replace(event, at=at) for event in met),
            *self._told,
        )
        self._told.clear()
        return Publication(log.position, chunks, events)

    def log_of(self, session_id: str) -> SessionLog:
        """See `Publisher`; another server continues with this time."""
        log, clock = super().log_of(session_id), self._clock
        return replace(log, motion=clock.seconds, last_at=clock.next)


class LockStepThread:
    """Serves the calls on a world, and steps it when it is asked to."""

    def __init__(
        self, world: World, offline: Offline, clock: ManualClock, meter: MetricsSink
    ) -> None:
        self.world = world
        self.inbox = Inbox(INBOX)
        self.publisher = LockStepPublisher(world, clock, meter)
        self.clock = clock
        self._offline = offline
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="lock-step", daemon=True)

    def start(self) -> None:
        """Accepts calls from now on."""
        self._thread.start()
        self.inbox.open()

    def end(self, reason: str, error: type[WayfarerError] = Unavailable) -> None:
        """Ends the thread soon, and refuses waiting calls."""
        self._ended = True
        self.inbox.close(reason, error)
        self.inbox.wake()  # last, since closing empties the queue

    async def stop(self) -> None:
        """Ends the thread; returns when that is done."""
        self.end("the server has been stopped")
        await asyncio.to_thread(self._thread.join)

    async def step(self, session_id: str, steps: int) -> list[Publication]:
        """Steps primitives; returns the publication of each. Raises ResourceExhausted."""
        return await self.inbox.ask(lambda: self._advance(session_id, steps))

    def _run(self) -> None:
        while not self._ended:
            self.inbox.serve(WAIT)

    def _advance(self, session_id: str, steps: int) -> list[Publication]:
        with self._offline.place():
            published = [self._primitive(session_id) for _ in range(steps)]
        self.world.checkpoint()
        return published

    def _primitive(self, session_id: str) -> Publication:
        """Plans the primitive that begins 0.2 s from now, then lets that time pass.

        So planned motion is sent at once, and a change of goals never discards any of it.
        """
        while self.world.step(self.clock.next):
            pass
        self.clock.advance()
        parts = [due.chunks for due in self.world.take_due(self.clock.next)]
        chunks = MotionChunks.join(parts) if parts else NO_CHUNKS
        met = [event for _, event in self.world.take_events()]
        return self.publisher.gather(session_id, chunks, met)


class LockSteps:
    """All sessions in lock-step, by their ids and those of their agents. Thread-safe."""

    def __init__(
        self,
        worlds: Worlds,
        offline: Offline,
        clock: Callable[[], float],
        meter: MetricsSink | None = None,
    ) -> None:
        self._worlds = worlds
        self._limits = worlds.settings.limits
        self._offline = offline
        self._clock = clock
        self._meter = meter or MetricsSink()
        self._workshop = ThreadPoolExecutor(1, "newcomers")
        self._sessions: dict[str, tuple[LiveMotion, LockStepThread]] = {}
        self._agents: dict[str, LiveMotion] = {}
        self._new_sessions = self._new_agents = 0  # being made, and not yet in the dicts
        self._lock = threading.Lock()  # for changes: other threads put sessions in, too

    def session(self, session_id: str) -> LiveMotion | None:
        """The home of a session, if it is in lock-step."""
        found = self._sessions.get(session_id)
        return found and found[0]

    def agent(self, agent_id: str) -> LiveMotion | None:
        """The home of an agent, if it is in lock-step."""
        return self._agents.get(agent_id)

    async def step(self, session_id: str, steps: int) -> list[Publication]:
        """See `LockStepThread`."""
        return await self._sessions[session_id][1].step(session_id, steps)

    @contextmanager
    def opening(
        self,
        session_id: str | None = None,
        agents: int = 0,
        log: SessionLog | None = None,
        admit: bool = True,
    ) -> Iterator[LiveMotion]:
        """A home for one session, which the caller puts in, with this number of agents.

        `log` is the progress of a session that moves. Without `admit`: also beyond
        `limits.sessions`. Raises AlreadyExists, ResourceExhausted.
        """
        if session_id in self._sessions:
            raise AlreadyExists(f"session {session_id!r} exists already")
        clock = ManualClock(self._clock())
        if log is not None and log.last_at is not None:
            clock = ManualClock(log.last_at - log.motion, log.motion)
        with self._room(int(admit), agents):
            world = self._worlds.lock_step()
            thread = LockStepThread(world, self._offline, clock, self._meter)
            home = LiveMotion(world, thread, self._meter, workshop=self._workshop)
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
        """Implements `MotionService`, as do the methods below."""
        home, _ = self._sessions[session_id]
        with self._room(0, len(specs)):
            agents = await home.create_agents(session_id, specs, names)
            with self._lock:
                self._agents.update((agent.agent_id, home) for agent in agents)
        return agents

    async def delete_agent(self, agent_id: str) -> None:
        """Deletes an agent."""
        await self._agents[agent_id].delete_agent(agent_id)
        with self._lock:
            self._agents.pop(agent_id, None)

    async def delete_session(self, session_id: str, error: WayfarerError | None = None) -> None:
        """Deletes a session, and ends its thread."""
        home, thread = self._sessions[session_id]
        await home.delete_session(session_id, error)
        with self._lock:
            self._sessions.pop(session_id, None)
            left = {name: other for name, other in self._agents.items() if other is not home}
            self._agents = left
        thread.end(f"session {session_id!r} has been deleted", NotFound)

    def infos(self) -> list[SessionInfo]:
        """All sessions, at once: a busy world is read instead of asked.

        Only whole values are read, and only the names of agents.
        """
        found = []
        for name, (_, thread) in list(self._sessions.items()):
            with suppress(NotFound):  # deleted meanwhile
                found.append(thread.world.get_session(name))
        return found

    async def use_model(self, name: str) -> int:
        """Uses a model in all of them; see `LiveMotion.use_model`."""
        moved = 0
        for home, _ in list(self._sessions.values()):
            with suppress(NotFound):  # deleted meanwhile
                moved += await home.use_model(name)
        return moved

    async def stop(self) -> None:
        """Ends all of them."""
        homes = list(self._sessions.values())
        await asyncio.gather(*(thread.stop() for _, thread in homes))
        self._workshop.shutdown(wait=False, cancel_futures=True)

    @contextmanager
    def _room(self, sessions: int, agents: int) -> Iterator[None]:
        """Reserves room for agents while they are made. Raises ResourceExhausted."""
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
