"""Publishes sessions' motion: positions, a ring for resuming readers, deliveries to subscribers.

Runs on the motion thread. Subscribers are reached through their event loops, each of which is
called once per `flush`, however many subscribers it has.
"""

import asyncio
import secrets
import weakref
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Final

from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument, Unavailable, WayfarerError
from wayfarer.runtime.inbox import post
from wayfarer.runtime.metrics_sink import MetricsSink, ResumeResult
from wayfarer.runtime.streams.goal_events import GoalEvents
from wayfarer.runtime.streams.publications import Publication, Resume, SlowReader
from wayfarer.runtime.streams.root_tracks import Roots, RootTracks
from wayfarer.runtime.streams.sights import best_of
from wayfarer.runtime.streams.subscription import (
    KeptPublication,
    QueuedPublication,
    Subscription,
    SubscriptionStart,
)
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import NO_CHUNKS, AgentInfo, MotionChunks, Sight
from wayfarer.world.agents.faults import Faults, Stage
from wayfarer.world.agents.records import SessionRecord
from wayfarer.world.events import Event, EventKind

MIN_STEP: Final = 1e-3
"""Minimum seconds that a publication counts, so that a limit in seconds limits their number."""

Delivery = tuple[Subscription, QueuedPublication, bool]


class Publisher:
    """The logs of all sessions. A session's log begins when it is first needed."""

    def __init__(
        self, limits: Limits, meter: MetricsSink, info: Callable[[str], AgentInfo], faults: Faults
    ) -> None:
        """`info(agent_id)` returns an agent with its session and path."""
        self._faults = faults
        self._limits = limits
        self._meter = meter
        self._info = info
        self._logs: dict[str, _Log] = {}
        self._holders: set[str] = set()  # sessions that have had subscribers with HOLD
        self._deliveries: dict[asyncio.AbstractEventLoop, list[Delivery]] = defaultdict(list)

    def publish(self, session_id: str, chunks: MotionChunks, ahead: bool = False) -> None:
        """Publishes chunks of a session, with their goal events. They are due now, or leave `ahead`
        of their time: then no reader is slow that has not taken those before.
        """
        log = self._log(session_id)
        log.answer(chunks, self._meter)
        self._deliver(session_id, log, chunks, log.goal_events.events(chunks), ahead)

    def sights(self, session_id: str, chunks: MotionChunks) -> list[Sight] | Sight:
        """How well the readers of a session see the agents [A] of these chunks."""
        return self._log(session_id).sights(chunks)

    def tell(self, session_id: str, events: Sequence[Event]) -> None:
        """Publishes other events, also to subscribers that resume."""
        log = self._log(session_id)
        self._deliver(session_id, log, NO_CHUNKS, tuple(events))

    def flush(self) -> None:
        """Delivers the events that were noted since the last call."""
        deliveries, self._deliveries = self._deliveries, defaultdict(list)
        for loop, batch in deliveries.items():
            post(loop, self._put, batch)

    def subscribe(self, subscription: Subscription, now: float) -> None:
        """Starts a subscription at the position that it asks for. Raises InvalidArgument."""
        log = self._log(subscription.session_id)
        start = self._start(log, subscription.options.resume, now)
        log.follow(subscription)
        if subscription.options.slow_reader is SlowReader.HOLD:
            self._holders.add(subscription.session_id)
        post(subscription.loop, subscription.begin, start)

    def await_goal(self, session_id: str, agent_id: str, revision: int, asked_at: float) -> None:
        """Starts to measure the time until the first chunk of a goal."""
        self._log(session_id).awaited[agent_id] = revision, asked_at

    def adopt(self, record: SessionRecord) -> None:
        """Adopts a session from another server; some of its agents are about to end their paths."""
        goal_events = self._log(record.session_id).goal_events
        for agent in record.agents:
            goal_events.adopt(agent)

    def log_of(self, session_id: str) -> "SessionLog":
        """The log with which its streams resume on another server."""
        return self._log(session_id).state()

    def restore(self, session_id: str, state: "SessionLog") -> None:
        """Continues a session's log from another server, before anybody subscribes on this one."""
        self._log(session_id).restore(state)

    def forget_agent(self, session_id: str, agent_id: str) -> None:
        """Forgets a deleted agent."""
        if log := self._logs.get(session_id):
            log.awaited.pop(agent_id, None)
            log.goal_events.forget(agent_id)
            if log.roots is not None:
                log.roots.forget(agent_id)

    def end(self, session_id: str, error: WayfarerError | None = None) -> None:
        """Ends a session's subscriptions and forgets it; if its id returns, it starts afresh."""
        self.flush()
        self._holders.discard(session_id)
        if log := self._logs.pop(session_id, None):
            for subscription in log.open():
                post(subscription.loop, subscription.end, error)

    def end_all(self, error: WayfarerError | None) -> None:
        """Ends every session's subscriptions."""
        for session_id in list(self._logs):
            self.end(session_id, error)

    def waiting_sessions(self, now: float) -> list[str]:
        """Sessions whose agents must wait: all their readers have HOLD and have stalled."""
        found = list[str]()
        for name in list(self._holders):
            try:
                if not self._logs[name].has_holders():
                    self._holders.discard(name)
                elif self._logs[name].waits(now, self._limits.queue_s):
                    found.append(name)
            except Exception as error:  # its agents do not wait
                self._holders.discard(name)
                self._faults.session(name, Stage.SCHEDULE, error)
        return found

    def open(self) -> Iterator[Subscription]:
        """The open subscriptions of all sessions."""
        for log in self._logs.values():
            yield from log.open()

    # Private

    def _log(self, session_id: str) -> "_Log":
        if session_id not in self._logs:
            failed = partial(self._faults.agent, stage=Stage.EVENT)
            self._logs[session_id] = _Log(self._limits.resume_s, GoalEvents(self._info, failed))
        return self._logs[session_id]

    def _deliver(
        self,
        session_id: str,
        log: "_Log",
        chunks: MotionChunks,
        events: tuple[Event, ...],
        spare: bool = False,
    ) -> None:
        most = self._limits.queue_s
        readers = [(reader, spare or log.spares(reader, most)) for reader in log.open()]
        _pack(chunks, (reader for reader, _ in readers))
        entry = log.add(chunks, events, self._roots(session_id, log, chunks))
        for reader, spare in readers:
            self._deliveries[reader.loop].append((reader, entry, spare))

    def _roots(self, session_id: str, log: "_Log", chunks: MotionChunks) -> Roots | None:
        """Returns None if no reader asks for roots, or they fail."""
        if log.roots is None or not chunks:
            return None
        try:
            return log.roots.follow(chunks)
        except Exception as error:
            log.roots = RootTracks()  # its state may be the cause of the failure
            self._faults.session(session_id, Stage.ROOTS, error)
            return None

    def _put(self, deliveries: Iterable[Delivery]) -> None:
        """Runs on the subscriptions' event loop. A failing one is ended, and may resume."""
        for subscription, entry, spare in deliveries:
            try:
                subscription.put(entry, spare)
            except Exception as error:
                subscription.closed = True
                subscription.end(Unavailable("an error in the server ended this stream; resume it"))
                self._faults.elsewhere(subscription.session_id, Stage.DELIVERY, error)

    def _start(self, log: "_Log", resume: Resume | None, now: float) -> SubscriptionStart:
        if resume is None:
            return SubscriptionStart(log.epoch, log.position, log.motion)
        if resume.epoch != log.epoch:
            self._meter.resume(ResumeResult.NEW_EPOCH)
            return log.present(0, _gap(now, "the server has restarted the session since"))
        if not 0 <= resume.position <= log.position:
            raise InvalidArgument(
                f"position is {resume.position}; allowed: 0 to {log.position}, the last one sent",
                "resume.position",
            )
        if log.holds_after(resume.position):
            self._meter.resume(ResumeResult.RESUMED)
            return log.after(resume.position)
        self._meter.resume(ResumeResult.GAP)
        lost = log.position - resume.position
        held = f"{self._limits.resume_s:g} s of motion are held"
        return log.present(resume.position, _gap(now, f"{lost} publications were lost: {held}"))


@dataclass(frozen=True, slots=True)
class SessionLog:
    """The last publications of a session."""

    epoch: str
    position: int
    motion: float  # seconds so far
    last_at: float | None  # Unix seconds of the last motion
    stopping: Mapping[str, tuple[int, int]]  # see `GoalEvents`
    held: tuple[KeptPublication, ...]  # for streams that resume


class _Log:
    """One session: its last publications, and its subscriptions."""

    def __init__(self, resume_s: float, goal_events: GoalEvents) -> None:
        self.epoch = secrets.token_hex(8)
        self.position = 0
        self.goal_events = goal_events
        self.awaited: dict[str, tuple[int, float]] = {}  # goal revision and time asked, by agent
        self.is_waiting = False  # the agents wait for their readers
        self.roots: RootTracks | None = None  # from the first subscriber that asks for them
        self._resume_s = resume_s
        self._ring: deque[KeptPublication] = deque()
        self.motion = 0.0  # seconds of motion so far
        self._last_at: float | None = None
        self._subscribers: list[weakref.ref[Subscription]] = []
        self._waiting_since: float | None = None

    def add(
        self, chunks: MotionChunks, events: tuple[Event, ...], roots: Roots | None
    ) -> QueuedPublication:
        """Enters a publication into the ring."""
        self.position += 1
        publication = Publication(self.position, chunks, events, roots=roots)
        self.motion += self._step(publication)
        entry = QueuedPublication(publication, self.motion)
        self._ring.append(KeptPublication.of(entry))
        while self.motion - self._ring[0].motion > self._resume_s:
            self._ring.popleft()
        return entry

    def _step(self, publication: Publication) -> float:
        """Seconds of motion since the last publication; a gap in the schedule does not count."""
        if not publication.chunks:
            return MIN_STEP
        at, last = publication.scheduled_at, self._last_at
        self._last_at = at
        return MIN_STEP if last is None else min(max(at - last, MIN_STEP), STEP_SECONDS)

    def answer(self, chunks: MotionChunks, meter: MetricsSink) -> None:
        """Measures the latency of goals whose first chunks are among these."""
        if not self.awaited:
            return
        for row, agent_id in enumerate(chunks.agent_id):
            revision, asked_at = self.awaited.get(agent_id, (None, 0.0))
            if revision is not None and chunks.goal_revision[row] >= revision:
                del self.awaited[agent_id]
                meter.goal_to_motion(float(chunks.scheduled_at[row]) - asked_at)

    def state(self) -> SessionLog:
        """The log for another server."""
        held, stopping = tuple(self._ring), dict(self.goal_events.stopping)
        return SessionLog(self.epoch, self.position, self.motion, self._last_at, stopping, held)

    def restore(self, state: SessionLog) -> None:
        """Continues a log from another server."""
        self.epoch, self.position, self.motion = state.epoch, state.position, state.motion
        self._last_at, self._ring = state.last_at, deque(state.held)
        self.goal_events.stopping = dict(state.stopping)

    def sights(self, chunks: MotionChunks) -> list[Sight] | Sight:
        """How well the readers see the agents [A]; one value if no reader has rings."""
        options = [reader.options for reader in self.open() if not reader.options.events_only]
        ringed = [each.sights for each in options if each.sights is not None]
        if not ringed or len(ringed) < len(options):
            return Sight.NEAR
        return best_of(ringed, chunks.alias.tolist())

    # Starts

    def present(self, position: int, gap: Event) -> SubscriptionStart:
        """A start with the next chunks due; everything since `position` is lost."""
        opening = Publication(position, events=(gap,))
        return SubscriptionStart(self.epoch, self.position, self.motion, opening=opening)

    def holds_after(self, position: int) -> bool:
        """Whether the ring holds everything after a position."""
        first = self._ring[0].publication.position if self._ring else self.position + 1
        return first <= position + 1

    def after(self, position: int) -> SubscriptionStart:
        """A start right after `position`."""
        motion = self.motion
        for entry in self._ring:
            if entry.publication.position > position:
                motion = entry.motion
                break
        return SubscriptionStart(self.epoch, position, motion, resumed=True, held=tuple(self._ring))

    # Subscribers

    def follow(self, subscription: Subscription) -> None:
        """Adds a subscription."""
        if subscription.options.roots and self.roots is None:
            self.roots = RootTracks()
        self._subscribers = [*map(weakref.ref, self.open()), weakref.ref(subscription)]

    def open(self) -> list[Subscription]:
        """The open subscriptions; closed and vanished ones are forgotten."""
        found = [ref() for ref in self._subscribers]
        kept = [s for s in found if s is not None and not (s.closed or s.loop.is_closed())]
        if len(kept) < len(found):
            self._subscribers = [*map(weakref.ref, kept)]
        return kept

    def has_holders(self) -> bool:
        """Whether a subscription asks the agents to wait."""
        return any(reader.options.slow_reader is SlowReader.HOLD for reader in self.open())

    def has_stalled(self, reader: Subscription, queue_s: float) -> bool:
        """Whether more than `queue_s` seconds of motion wait for it."""
        return self.motion - reader.taken > queue_s

    def spares(self, reader: Subscription, queue_s: float) -> bool:
        """Whether nothing may be dropped for it: the agents wait, or will as soon as it stalls."""
        return reader.options.slow_reader is SlowReader.HOLD and (
            self.is_waiting or not self.has_stalled(reader, queue_s)
        )

    def waits(self, now: float, queue_s: float) -> bool:
        """Whether agents wait: all readers hold and have stalled, within the shortest `hold_s`."""
        following = self.open()
        stalled = all(
            reader.options.slow_reader is SlowReader.HOLD and self.has_stalled(reader, queue_s)
            for reader in following
        )
        if not following or not stalled:
            self._waiting_since = None
        elif self._waiting_since is None:
            self._waiting_since = now
        self.is_waiting = self._waiting_since is not None and now - self._waiting_since < min(
            reader.options.hold_s for reader in following
        )
        return self.is_waiting


def _pack(chunks: MotionChunks, readers: Iterable[Subscription]) -> None:
    """Packs due chunks ahead: compiled code runs beside the event loop, which only writes."""
    for reader in readers if chunks else ():
        if reader.options.pack is not None:
            with suppress(Exception):  # the stream packs again, and ends with the error
                reader.options.pack(chunks)


def _gap(now: float, reason: str) -> Event:
    return Event(EventKind.GAP, now, detail=f"begins at the present: {reason}")
