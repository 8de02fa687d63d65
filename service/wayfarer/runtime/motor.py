"""The only thread: take commands, step agents, publish chunks.

A turn: serve the inbox → take in what the engine has made → set it going for whoever is due →
publish what falls due → again, or wait for the next event or command. The engine works beside the
thread (`crew.py`). Frames keep their schedule, so a late turn is followed by bigger batches, not by
later ones. Only when the thread is more than a second behind (an overloaded or suspended machine)
the whole schedule is moved back, and `rebased` in the statistics says so.

An error in a turn is logged and counted, `ready` is false until a turn succeeds again, and the
turn is tried again; after `FAILURES` in a row the thread ends, and with it every stream and command
(Unavailable).
"""

import asyncio
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, auto
from functools import partial
from typing import Final, TypeVar

import numpy as np
import structlog

from wayfarer.errors import Unavailable
from wayfarer.runtime.crew import Crew
from wayfarer.runtime.inbox import Inbox
from wayfarer.runtime.meter import Meter
from wayfarer.runtime.publications import Event, EventKind
from wayfarer.runtime.stats import LoopStats, Window, mean, percentile
from wayfarer.runtime.stepping.scheduler import Flight
from wayfarer.runtime.streams.publisher import Publisher
from wayfarer.runtime.world.views import Due
from wayfarer.runtime.world.world import World
from wayfarer.spec import FPS

log = structlog.get_logger(__name__)

T = TypeVar("T")

ALIVE_SECONDS: Final = 1.0  # without a turn for so long the thread counts as hung
HEARTBEAT: Final = 0.25  # the longest wait, so that an idle thread is seen to be alive
BEHIND_SECONDS: Final = 1.0  # beyond this the schedule is moved
LATE_SECONDS: Final = 1 / FPS  # a chunk that leaves later than one frame after its time is late
EARLY_SECONDS: Final = 1 / FPS  # chunks leave so long before their time, rather than late
HOLD_SECONDS: Final = 0.5  # agents that wait are put off by this, turn by turn
FAILURES: Final = 10  # failed turns in a row that end the thread
RETRY_SECONDS: Final = 0.05  # pause after a failed turn


class Phase(Enum):
    """The life of the thread."""

    NEW = auto()
    WARMING = auto()
    RUNNING = auto()
    ENDED = auto()


@dataclass(slots=True)
class Figures:
    """What the thread counts, since its start or over the last seconds."""

    steps: int = 0  # of agents
    late: int = 0  # chunks
    failures: int = 0  # turns
    rebased: int = 0
    held: int = 0  # sessions whose agents wait now
    worked: float = 0.0  # seconds of the thread's own since the last engine call was taken in
    published: int = 0  # chunks, since then
    step_seconds: Window = field(default_factory=Window)
    lateness: Window = field(default_factory=Window)  # of the latest chunk of each turn


class Motor:
    """Turns a world, in a thread of its own."""

    def __init__(
        self,
        world: World,
        publisher: Publisher,
        inbox: Inbox,
        warm_up: Callable[[], None],
        clock: Callable[[], float],
        meter: Meter,
    ) -> None:
        """`warm_up` is called on the thread before the first turn."""
        self._world = world
        self._publisher = publisher
        self._inbox = inbox
        self._warm_up = warm_up
        self._clock = clock
        self._meter = meter
        self._phase = Phase.NEW
        self._stopping = False
        self._crew = Crew(clock, inbox.wake)
        self._thread = threading.Thread(target=self._run, name="motion-loop", daemon=True)
        self._started_at = self._beat = clock()
        self._failures_in_a_row = 0
        self._figures = Figures()

    def start(self) -> None:
        """Start the thread, once."""
        self._phase = Phase.WARMING
        self._thread.start()

    async def stop(self) -> None:
        """End the thread, every stream and every waiting command; return when that is done."""
        self._stopping = True
        self._inbox.wake()
        if self._thread.is_alive():
            await asyncio.to_thread(self._thread.join)

    @property
    def ready(self) -> bool:
        """Warm, running, and the last turn went well."""
        return self._phase is Phase.RUNNING and self._failures_in_a_row == 0

    @property
    def alive(self) -> bool:
        """Warming up, or a turn, and what the engine was at, were done within the last second."""
        if self._phase is Phase.WARMING:
            return self._thread.is_alive()
        now = self._clock()
        hung = now - self._beat >= ALIVE_SECONDS or self._crew.age(now) >= ALIVE_SECONDS
        return self._phase is Phase.RUNNING and not hung

    def stats(self) -> LoopStats:
        """To be called on the thread."""
        now, figures = self._clock(), self._figures
        steps = [1e3 * s for s in figures.step_seconds.values(now)]
        open_ = list(self._publisher.open())
        return LoopStats(
            agents=self._world.agents,
            sessions=self._world.sessions,
            subscribers=len(open_),
            steps=figures.steps,
            step_ms_mean=mean(steps),
            step_ms_p95=percentile(steps, 95),
            late_chunks=figures.late,
            lateness_ms_p95=1e3 * percentile(figures.lateness.values(now), 95),
            uptime_s=now - self._started_at,
            resets=self._world.resets,
            failures=figures.failures,
            rebased=figures.rebased,
            dropped_batches=sum(subscription.dropped for subscription in open_),
            reduced_steps=self._world.reduced_steps,
            held_sessions=figures.held,
            states=self._world.states(),
            capacity=self._world.capacity(now),
            load=self._world.load(now),
            rung=self._world.rung_number,
            held_steps=self._world.held_steps,
            refused_agents=self._world.refused_agents,
        )

    # The thread

    def _run(self) -> None:
        reason = "the motion loop has been stopped"
        try:
            self._warm_up()
            self._beat = self._clock()
            self._phase = Phase.RUNNING
            self._inbox.open()
            while not self._stopping:
                self._try_turn()
        except Exception as error:
            reason = f"the motion loop has failed: {error}"
            log.exception("motion loop ended")
        self._crew.close()
        self._phase = Phase.ENDED
        self._inbox.close(reason)
        self._publisher.end_all(None if self._stopping else Unavailable(reason))

    def _try_turn(self) -> None:
        try:
            self._turn()
        except Exception as error:
            self._figures.failures += 1
            self._failures_in_a_row += 1
            log.error(
                "a turn of the motion loop failed",
                error=repr(error),
                in_a_row=self._failures_in_a_row,
                exc_info=self._failures_in_a_row == 1,  # the same trace ten times helps nobody
            )
            if self._failures_in_a_row >= FAILURES:
                raise
            time.sleep(RETRY_SECONDS)

    def _turn(self) -> None:
        self._beat = self._clock()
        self._keep_schedule(self._beat)
        self._inbox.serve(self._rest())
        started = self._clock()
        for session_id, agent_id in self._world.tend(started):
            self._publisher.forget_agent(session_id, agent_id)
            self._publisher.tell(session_id, [Event(EventKind.AGENT_LEFT, started, agent_id)])
        landed = False
        for flight, seconds in self._crew.landed():
            self._take_in(flight, seconds)
            landed = True
        # the engine need not wait for those who are due soon
        while (landed and self._crew.is_idle) or (self._crew.has_room and self._is_due(started)):
            if not self._crew.send_off(partial(self._world.begin, started)):
                break
        self._publish(self._world.send(self._clock() + EARLY_SECONDS))
        for session_id, met in self._world.take_events():
            self._publisher.tell(session_id, [met])
        self._publisher.flush()
        self._figures.worked += self._clock() - started
        if landed:
            self._world.worked(started, self._figures.worked, self._figures.published)
            self._figures.worked, self._figures.published = 0.0, 0
        if landed or not self._crew.age(started):
            self._failures_in_a_row = 0

    def _rest(self) -> float:
        """Seconds until there is something to do, commands aside."""
        if self._crew.has_landed:
            return 0.0
        event = self._world.next_event(self._crew.has_room, EARLY_SECONDS)
        return HEARTBEAT if event is None else min(max(event - self._clock(), 0.0), HEARTBEAT)

    def _is_due(self, now: float) -> bool:
        event = self._world.next_event()
        return event is not None and event <= now

    def _take_in(self, flight: Flight, seconds: float) -> None:
        stepped, now = self._world.finish(flight), self._clock()
        self._world.spent(now, flight, seconds)
        self._figures.steps += stepped
        self._figures.step_seconds.add(now, seconds)
        self._meter.step(seconds, stepped)

    def _keep_schedule(self, now: float) -> None:
        """Move what cannot be kept, or what nobody reads who asked for all."""
        waiting = self._publisher.waiting_sessions(now)
        self._figures.held = len(waiting)
        for session_id in waiting:
            self._world.hold(session_id, now + HOLD_SECONDS)
        behind = self._world.behind(now)
        # while the engine hangs, nobody knows yet how far
        if behind > BEHIND_SECONDS > self._crew.age(now):
            self._world.rebase(behind)
            self._figures.rebased += 1
            log.warning("the motion loop is behind; schedule moved", seconds=round(behind, 3))

    def _publish(self, sent: list[Due]) -> None:
        if not sent:
            return
        now = self._clock()
        for session_id, chunks in sent:
            self._publisher.publish(session_id, chunks)
        lateness = now - np.concatenate([due.chunks.scheduled_at for due in sent])
        self._figures.lateness.add(now, max(0.0, float(lateness.max())))
        self._figures.late += int(np.count_nonzero(lateness > LATE_SECONDS))
        self._meter.chunks(lateness)
        self._figures.published += len(lateness)
