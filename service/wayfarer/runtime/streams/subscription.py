"""One subscriber's bounded queue of publications. Lives on the subscriber's event loop.

All limits count seconds of motion rather than of the clock: a schedule that waits, or is moved,
fills no queue.
"""

import asyncio
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from wayfarer.config.limits import Limits
from wayfarer.errors import (
    FailedPrecondition,
    InvalidArgument,
    ResourceExhausted,
    WayfarerError,
)
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.streams.publications import Publication, SlowReader, StreamOptions
from wayfarer.runtime.streams.sequence_tracker import SequenceTracker
from wayfarer.world.agents.agent import NO_CHUNKS
from wayfarer.world.events import Event, EventKind

MIN_WAITING: Final = 3
"""Minimum number of publications that are kept, however far apart they are in time."""

MAX_EVENTS: Final = 64
"""Maximum events of lost publications that are kept for a slow reader."""

STEPS_PER_ONE: Final = 1 << 14
"""Steps in which the numbers of a kept rotation count: it is at most 0.007° off."""

MAX_AHEAD: Final = 60.0
"""Maximum seconds of a playhead ahead of the clock; more means a wrong unit or clock."""


class QueuedPublication(NamedTuple):
    """A publication and its place in the motion of its session."""

    publication: Publication
    motion: float  # seconds of motion before it


@dataclass(frozen=True, slots=True)
class KeptPublication:
    """A publication kept for streams that resume, in half the bytes: its rotations are rounded."""

    publication: Publication  # whose chunks have no rotations
    motion: float  # seconds before it
    rotations: NDArray[np.int16]  # [A, F, 22, 4]

    @classmethod
    def of(cls, entry: QueuedPublication) -> Self:
        """Rounds rotations. Rounded ones stay the same."""
        publication, chunks = entry.publication, entry.publication.chunks
        steps = chunks.rotations * np.float32(STEPS_PER_ONE)
        rounded = np.rint(steps, out=steps).astype(np.int16)
        rest = replace(chunks, rotations=NO_CHUNKS.rotations)
        return cls(replace(publication, chunks=rest), entry.motion, rounded)

    @property
    def whole(self) -> QueuedPublication:
        """With rotations."""
        rotations = np.divide(self.rotations, STEPS_PER_ONE, dtype=np.float32)
        chunks = replace(self.publication.chunks, rotations=rotations)
        return QueuedPublication(replace(self.publication, chunks=chunks), self.motion)


class SubscriptionStart(NamedTuple):
    """The start of a subscription."""

    epoch: str
    position: int  # of the last publication before it
    motion: float  # its place in the motion
    resumed: bool = False  # nothing is missing between the reader's last one and the next
    held: tuple[
        KeptPublication, ...
    ] = ()  # of a resuming subscription: everything that the server holds
    opening: Publication | None = None  # is yielded first

    @property
    def replay(self) -> list[QueuedPublication]:
        """The publications that a resuming subscription has missed."""
        return [kept.whole for kept in self.held if kept.publication.position > self.position]


@dataclass(slots=True)
class _Loss:
    """Losses of a slow reader that no event has reported yet."""

    last: Publication
    count: int = 0
    events: deque[Event] = field(default_factory=lambda: deque(maxlen=MAX_EVENTS))

    def add(self, publication: Publication) -> None:
        self.last = publication
        self.count += 1
        self.events.extend(publication.events)

    def told(self, position: int) -> Publication:
        """An event GAP, and the events that were lost.

        `position`: of the last publication that was kept; a reader that resumes there may still get
        them.
        """
        lost = "1 publication was" if self.count == 1 else f"{self.count} publications were"
        detail = f"{lost} lost: the reader was too slow"
        gap = Event(EventKind.GAP, self.last.scheduled_at, detail=detail)
        return Publication(position, events=(gap, *self.events))


class Subscription:
    """A bounded queue of publications, for one reader, in order until the session ends.

    An agent's first chunk carries FIRST, a chunk after a lost one GAP. A GAP event, with the lost
    events, reports the losses to a slow reader before the next publication.
    """

    def __init__(
        self,
        session_id: str,
        options: StreamOptions,
        limits: Limits,
        meter: MetricsSink,
        clock: Callable[[], float],
    ) -> None:
        """Must be made on the reader's event loop. Accepts nothing before `begin`."""
        self.session_id = session_id
        self.options = options
        self.loop = asyncio.get_running_loop()
        self.epoch = ""
        """Changes when the session's positions start again: with a restart or an import."""
        self.resumed = False
        """Whether the subscription continues without a gap where `StreamOptions.resume` ended."""
        # These four are read by the motion thread.
        self.agent_ids = frozenset(options.agent_ids)
        self.closed = False
        self.dropped = 0  # publications lost so far
        self.taken = 0.0  # place in the motion of the reader's last publication
        self._limits = limits
        self.meter = meter
        self._clock = clock
        self._bound = limits.queue_s
        self._waiting: deque[QueuedPublication] = deque()
        self._loss: _Loss | None = None
        self._opening: Publication | None = None
        self._position = self._began = 0  # of the last publication yielded, and of that before all
        self._horizon = math.inf  # nothing that begins later is yielded
        self._tracker = SequenceTracker()
        self._ended = False
        self._error: WayfarerError | None = None
        self._waiter: asyncio.Future[None] | None = None

    def begin(self, start: SubscriptionStart) -> None:
        """Sets its start. Called on the reader's event loop, before the first `put`."""
        self.epoch, self.resumed = start.epoch, start.resumed
        self.taken, self._opening = start.motion, start.opening
        self._position = self._began = start.position
        resume = self.options.resume
        if resume is None or resume.same_agents:  # otherwise new agents are unknown
            self._tracker.learn((entry.publication for entry in start.held), start.position)
        for entry in start.replay:
            self.put(entry, spare=True)
        # until the reader has caught up; a resuming reader also waits for its header, and for the
        # descriptions of the agents in its first publication
        self._bound += max(self._span(), self._limits.resume_s if self.resumed else 0.0)

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Publication:
        """The next publication. Raises StopAsyncIteration at the end of the session.

        Raises ResourceExhausted if the reader was too slow, Unavailable if the loop failed.
        """
        if self._position > self._began and self._span() <= self._limits.queue_s:
            self._bound = self._limits.queue_s  # it has dealt with its first one
        while (publication := self._next()) is None:
            if self._ended:
                raise self._error or StopAsyncIteration
            if self._waiter is not None:
                raise FailedPrecondition("a subscription has one reader; another one is waiting")
            self._waiter = self.loop.create_future()
            try:
                await self._waiter
            finally:
                self._waiter = None
        self._position = publication.position
        return publication

    def ack(self, position: int, playhead: float) -> None:
        """Records that the reader has received everything up to `position` and shows the moment
        `playhead` (Unix s).

        From the first call on, only publications that begin within the lead after it are yielded.
        Raises InvalidArgument for impossible values.
        """
        if not 0 <= position <= self._position:
            raise InvalidArgument(
                f"position is {position}; allowed: 0 to {self._position}, the last one sent",
                "position",
            )
        latest = self._clock() + MAX_AHEAD
        if not (math.isfinite(playhead) and playhead <= latest):
            raise InvalidArgument(
                f"playhead is {playhead}; allowed: Unix seconds up to {latest:.3f}, "
                f"{MAX_AHEAD:g} s from now",
                "playhead",
            )
        self._horizon = playhead + self._limits.lead_s
        self._wake()

    async def close(self) -> None:
        """Stops receiving. Safe to call twice."""
        self.closed = True
        self._waiting.clear()
        self._opening = self._loss = None
        self.end()

    # Calls from the motion thread, through the event loop

    def put(self, entry: QueuedPublication, spare: bool) -> None:
        """Adds a publication; drops the oldest ones beyond the limit, unless `spare`.

        Nothing is dropped for a reader that waits: several publications come at once when this
        process got no CPU for a while.
        """
        if self._ended:
            return
        wanted = self._wanted(entry.publication)
        if wanted is None:
            if not self._waiting:
                self.taken = entry.motion
            return
        self._waiting.append(QueuedPublication(wanted, entry.motion))
        if not (spare or self._is_awaited()):
            self._keep_to_bound()
        self.meter.queue(self._span())
        self._wake()

    def end(self, error: WayfarerError | None = None) -> None:
        """Ends the queue; the reader still gets the waiting publications, and then `error`."""
        if not self._ended:
            self._ended, self._error = True, error
            self._horizon = math.inf
        self._wake()

    # Private

    def _is_awaited(self) -> bool:
        """Whether the reader waits: it is not slow, its event loop has not run since."""
        first = self._waiting[0].publication
        return self._waiter is not None and first.scheduled_at <= self._horizon

    def _span(self) -> float:
        waiting = self._waiting
        return waiting[-1].motion - waiting[0].motion if waiting else 0.0

    def _wanted(self, publication: Publication) -> Publication | None:
        """The part for this reader; None if it is empty."""
        ids = self.agent_ids
        if not ids:
            return publication
        rows = [row for row, name in enumerate(publication.chunks.agent_id) if name in ids]
        events = tuple(e for e in publication.events if not e.agent_id or e.agent_id in ids)
        if not rows and not events:
            return None
        chunks = publication.chunks.take(np.array(rows, np.int64))
        roots = None if publication.roots is None else publication.roots[rows]
        return replace(publication, chunks=chunks, events=events, roots=roots)

    def _keep_to_bound(self) -> None:
        while len(self._waiting) > MIN_WAITING and self._span() > self._bound:
            if self.options.slow_reader is SlowReader.DISCONNECT:
                self._disconnect()
            else:
                self._drop()

    def _drop(self) -> None:
        lost = self._waiting.popleft().publication
        self._loss = self._loss or _Loss(lost)
        self._loss.add(lost)
        self.dropped += 1
        self.meter.drops(self.options.slow_reader, 1)

    def _disconnect(self) -> None:
        count = len(self._waiting)
        self._waiting.clear()
        self._opening = None
        self.closed = True
        self.dropped += count
        self.meter.drops(SlowReader.DISCONNECT, count)
        self.end(
            ResourceExhausted(
                f"the reader was more than {self._limits.queue_s:g} s of motion behind and asked "
                "to be disconnected then; it may resume where it left off within "
                f"{self._limits.resume_s:g} s"
            )
        )

    def _next(self) -> Publication | None:
        """The next publication that may be yielded now, opening and losses first; None: there is
        none.
        """
        if self._opening is not None:
            opening, self._opening = self._opening, None
            return opening
        if self._loss is not None:
            loss, self._loss = self._loss, None
            return loss.told(self._position)
        if not self._waiting or self._waiting[0].publication.scheduled_at > self._horizon:
            return None
        entry = self._waiting.popleft()
        self.taken = entry.motion
        return self._tracker.put(entry.publication, entry.motion)

    def _wake(self) -> None:
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(None)
