"""Sessions in lock-step: each has its own world, in which time passes only on request.

A world has a thread and a bounded inbox, so a session that steps for long delays only its own
callers.
"""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from math import floor
from typing import Final, TypeVar

import numpy as np

from wayfarer.errors import AlreadyExists, NotFound, ResourceExhausted, Unavailable, WayfarerError
from wayfarer.runtime.inbox import Inbox
from wayfarer.runtime.offline import Offline
from wayfarer.runtime.persistence.capture import capture_session
from wayfarer.runtime.persistence.session_record import CapturedSession
from wayfarer.runtime.streams.goal_events import GoalEvents
from wayfarer.runtime.streams.publications import Publication, model_changed
from wayfarer.runtime.streams.publisher import SessionLog
from wayfarer.runtime.worlds import Worlds
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import (
    NO_CHUNKS,
    AgentInfo,
    AgentSpec,
    MotionChunks,
    SessionInfo,
    SessionSpec,
)
from wayfarer.world.agents.faults import Stage
from wayfarer.world.agents.records import SessionRecord
from wayfarer.world.events import Event
from wayfarer.world.world import World

T = TypeVar("T")

LOCK_STEP: Final = "lock-step"
"""The epoch of its log; no stream resumes there."""

INBOX: Final = 256
"""Maximum number of commands that wait in one session."""

WAIT: Final = 60.0
"""Seconds between checks whether an unused session still exists."""

HAIR: Final = 2e-4
"""Seconds before the next primitive at which calls see the world, so new agents start with it."""


class LockStep:
    """The world of one session, and the thread that owns it."""

    def __init__(self, world: World, offline: Offline, started_at: float) -> None:
        """`started_at`: Unix seconds. Put a session into the world, then call `start`."""
        self.world = world
        self._offline = offline
        self._started_at = floor(started_at / STEP_SECONDS) * STEP_SECONDS  # like agents' steps
        self._inbox = Inbox(INBOX)
        self._goal_events = GoalEvents(
            world.get_agent, partial(world.faults.agent, stage=Stage.EVENT)
        )
        self._pending_events: list[Event] = []  # since the last primitive
        self._steps = self._position = 0
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="lock-step", daemon=True)

    @property
    def now(self) -> float:
        """Unix seconds, as the world sees them."""
        return self._next - HAIR

    @property
    def _next(self) -> float:
        """The time at which the next primitive begins."""
        return self._started_at + self._steps * STEP_SECONDS

    def start(self) -> None:
        """Accepts calls from now on."""
        self._thread.start()
        self._inbox.open()

    def end(self, reason: str, error: type[WayfarerError] = Unavailable) -> None:
        """Ends the thread, and refuses waiting calls."""
        self._ended = True
        self._inbox.close(reason, error)
        self._inbox.wake()  # last, since closing empties the queue

    def join(self) -> None:
        """Waits for the thread's end."""
        self._thread.join()

    async def ask(self, call: Callable[[World, float], T]) -> T:
        """Calls with the world and its time. Raises Unavailable, or what `call` raises."""
        return await self._inbox.ask(lambda: call(self.world, self.now))

    async def step(self, steps: int) -> list[Publication]:
        """Steps primitives; returns the publications of each, timed from the start of the session.

        Raises ResourceExhausted.
        """
        return await self._inbox.ask(lambda: self._advance(steps))

    async def create_agents(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentInfo]:
        """Implements `MotionService`."""
        return await self.ask(lambda world, now: world.create_agents(session_id, specs, now))

    async def delete_agent(self, agent_id: str) -> None:
        """Implements `MotionService`."""
        await self.ask(lambda world, _: world.delete_agent(agent_id))
        self._goal_events.forget(agent_id)

    async def delete_session(self, session_id: str) -> None:
        """Implements `MotionService`."""
        await self.ask(lambda world, _: world.delete_session(session_id))

    async def use_model(self, name: str) -> int:
        """Moves all agents with a loaded model; returns how many had another. Raises NotFound."""
        return await self.ask(lambda *_: self._use_model(name))

    async def taken(self, session_id: str) -> CapturedSession:
        """The state of the session for another server, between two steps. Raises NotFound."""
        return await self.ask(lambda *_: self._taken(session_id))

    def _taken(self, session_id: str) -> CapturedSession:
        session = self.world.registry.session(session_id)
        seconds, stopping = self._steps * STEP_SECONDS, dict(self._goal_events.stopping)
        log = SessionLog(LOCK_STEP, self._position, seconds, None, stopping, ())
        rows = self.world.members.live_rows(session, lambda rows: np.zeros(len(rows)))
        return capture_session(self.world, session_id)._replace(rows=rows, log=log)

    def go_on(self, log: SessionLog) -> None:
        """Continues the log of another server; called before `start`."""
        self._position, self._steps = log.position, round(log.motion / STEP_SECONDS)
        self._started_at -= self._steps * STEP_SECONDS
        self._goal_events.stopping.update(log.stopping)

    def _use_model(self, name: str) -> int:
        moved = self.world.use_model(name)
        self._pending_events += [
            model_changed(agent, self._steps * STEP_SECONDS) for agent in moved
        ]
        return len(moved)

    def _run(self) -> None:
        while not self._ended:
            self._inbox.serve(WAIT)

    def _advance(self, steps: int) -> list[Publication]:
        with self._offline.place():
            published = [self._primitive() for _ in range(steps)]
        self.world.checkpoint()
        return published

    def _primitive(self) -> Publication:
        """Plans the primitive that begins 0.2 s from now, then lets that time pass.

        So planned motion is sent at once, and a change of goals never discards any of it.
        """
        while self.world.step(self._next):
            pass
        self._steps += 1
        self._position += 1
        parts = [due.chunks for due in self.world.take_due(self._next)]
        chunks = MotionChunks.join(parts) if parts else NO_CHUNKS
        chunks.scheduled_at[:] = self._steps * STEP_SECONDS
        met = [replace(e, at=self._steps * STEP_SECONDS) for _, e in self.world.take_events()]
        events = (*self._goal_events.events(chunks), *met, *self._pending_events)
        self._pending_events.clear()
        return Publication(self._position, chunks, events)


class LockSteps:
    """All sessions in lock-step, by their ids and those of their agents. Thread-safe."""

    def __init__(self, worlds: Worlds, offline: Offline, clock: Callable[[], float]) -> None:
        self._worlds = worlds
        self._limits = worlds.settings.limits
        self._offline = offline
        self._clock = clock
        self._sessions: dict[str, LockStep] = {}
        self._agents: dict[str, LockStep] = {}
        self._new_sessions = self._new_agents = 0  # being made, and not yet in the dicts
        self._lock = threading.Lock()  # for changes: other threads put sessions in, too

    def session(self, session_id: str) -> LockStep | None:
        """The home of a session, if it is in lock-step."""
        return self._sessions.get(session_id)

    def agent(self, agent_id: str) -> LockStep | None:
        """The home of an agent, if it is in lock-step."""
        return self._agents.get(agent_id)

    def create(self, spec: SessionSpec) -> SessionInfo:
        """Opens a session. Raises InvalidArgument, ResourceExhausted."""
        return self._open(lambda home: home.world.create_session(spec, self._clock()), 0)

    def put(
        self,
        record: SessionRecord,
        log: SessionLog | None = None,
        entered: Callable[[], None] = lambda: None,
        admit: bool = True,
    ) -> SessionInfo:
        """Resumes a session; `log` is its progress, if known.

        `entered` is called before it takes calls. Without `admit`: also beyond `limits.sessions`.
        """
        if record.session_id in self._sessions:
            raise AlreadyExists(f"session {record.session_id!r} exists already")

        def enter(home: LockStep) -> SessionInfo:
            if log is not None:
                home.go_on(log)
            session = home.world.members.put_session(record, home.now, admit=False)
            entered()
            return session.info()

        return self._open(enter, len(record.agents), admit)

    async def create_agents(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentInfo]:
        """See `MotionService`."""
        home = self._sessions[session_id]
        with self._room(0, len(specs)):
            agents = await home.create_agents(session_id, specs)
            with self._lock:
                self._agents.update((agent.agent_id, home) for agent in agents)
        return agents

    async def delete_agent(self, agent_id: str) -> None:
        """Implements `MotionService`."""
        await self._agents[agent_id].delete_agent(agent_id)
        with self._lock:
            self._agents.pop(agent_id, None)

    async def delete_session(self, session_id: str) -> None:
        """Implements `MotionService`."""
        home = self._sessions[session_id]
        await home.delete_session(session_id)
        with self._lock:
            self._sessions.pop(session_id, None)
            left = {name: other for name, other in self._agents.items() if other is not home}
            self._agents = left
        home.end(f"session {session_id!r} has been deleted", NotFound)

    def infos(self) -> list[SessionInfo]:
        """All sessions, at once: a busy world is read instead of asked.

        Only whole values are read, and only the names of agents.
        """
        found = []
        for name, home in list(self._sessions.items()):
            with suppress(NotFound):  # deleted meanwhile
                found.append(home.world.get_session(name))
        return found

    async def use_model(self, name: str) -> int:
        """Uses a model in all of them; see `LockStep.use_model`."""
        moved = 0
        for home in list(self._sessions.values()):
            with suppress(NotFound):  # deleted meanwhile
                moved += await home.use_model(name)
        return moved

    def stop(self, reason: str) -> None:
        """Ends all of them."""
        homes = list(self._sessions.values())
        for home in homes:
            home.end(reason)
        for home in homes:
            home.join()

    def _open(
        self, enter: Callable[[LockStep], SessionInfo], agents: int, admit: bool = True
    ) -> SessionInfo:
        with self._room(int(admit), agents):
            home = LockStep(self._worlds.lock_step(), self._offline, self._clock())
            session = enter(home)
            home.start()
            with self._lock:
                self._sessions[session.session_id] = home
                self._agents |= dict.fromkeys(session.agent_ids, home)
        return session

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
