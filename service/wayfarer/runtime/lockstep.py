"""The thread of a session in lock-step, in whose world time passes only on request."""

import asyncio
import threading
from collections.abc import Sequence
from dataclasses import replace
from math import floor
from typing import Final

from wayfarer.errors import Unavailable, WayfarerError
from wayfarer.runtime.inbox import Inbox
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.offline import Offline
from wayfarer.runtime.streams.publications import Publication
from wayfarer.runtime.streams.publisher import Publisher, SessionLog
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import NO_CHUNKS, MotionChunks
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
        self._events: list[Event] = []

    def tell(self, session_id: str, events: Sequence[Event]) -> None:
        """Keeps these for the next publication."""
        self._events += [replace(event, at=self._clock.seconds) for event in events]

    def gather(self, session_id: str, chunks: MotionChunks, met: Sequence[Event]) -> Publication:
        """The publication of a primitive that has passed; `met` on the agents' ways."""
        at, log = self._clock.seconds, self._log(session_id)
        chunks.scheduled_at[:] = at
        log.position += 1
        events = (
            *log.goal_events.events(chunks),
            *(replace(event, at=at) for event in met),
            *self._events,
        )
        self._events.clear()
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
