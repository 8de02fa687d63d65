"""The only thread: take commands, step agents, publish chunks.

A turn: serve the inbox → publish what falls due → one engine call → again, or wait for the next
event or command. Frames keep their schedule, so a late turn is followed by bigger batches, not by
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
from typing import Final, TypeVar

import numpy as np
import structlog

from wayfarer.errors import Unavailable
from wayfarer.runtime.agent import LoopStats
from wayfarer.runtime.inbox import Inbox
from wayfarer.runtime.meter import Meter
from wayfarer.runtime.stats import Window, mean, percentile
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
MAX_REACH: Final = 0.05  # chunks leave no earlier than this: they can no longer be replanned then
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
        """Warming up, or a turn was made within the last second."""
        if self._phase is Phase.WARMING:
            return self._thread.is_alive()
        return self._phase is Phase.RUNNING and self._clock() - self._beat < ALIVE_SECONDS

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
        self._phase = Phase.ENDED
        self._inbox.close(reason)
        self._publisher.end_all(None if self._stopping else Unavailable(reason))

    def _try_turn(self) -> None:
        try:
            self._turn()
            self._failures_in_a_row = 0
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
        event = self._world.next_event()
        wait = HEARTBEAT if event is None else min(max(event - self._clock(), 0.0), HEARTBEAT)
        self._inbox.serve(wait)

        started = self._clock()
        # What falls due during the engine call leaves before it, rather than late.
        event = self._world.next_event()
        busy = event is not None and event <= started
        published = self._publish(self._world.send(started + (self._reach() if busy else 0.0)))
        self._publisher.flush()
        if busy:
            self._step(started, published)

    def _step(self, started: float, published: int) -> None:
        begun = self._clock()
        self._world.worked(begun, begun - started, published)
        stepped = self._world.step(begun)
        if stepped:
            done = self._clock()
            self._figures.steps += stepped
            self._figures.step_seconds.add(done, done - begun)
            self._world.spent(done, done - begun)
            self._meter.step(done - begun, stepped)

    def _keep_schedule(self, now: float) -> None:
        """Move what cannot be kept, or what nobody reads who asked for all."""
        waiting = self._publisher.waiting_sessions(now)
        self._figures.held = len(waiting)
        for session_id in waiting:
            self._world.hold(session_id, now + HOLD_SECONDS)
        behind = self._world.behind(now)
        if behind > BEHIND_SECONDS:
            self._world.rebase(behind)
            self._figures.rebased += 1
            log.warning("the motion loop is behind; schedule moved", seconds=round(behind, 3))

    def _reach(self) -> float:
        """How long the next engine call may take: the longest of the last seconds, capped."""
        return min(max(self._figures.step_seconds.values(self._clock()), default=0.0), MAX_REACH)

    def _publish(self, sent: list[Due]) -> int:
        """Returns the number of chunks."""
        if not sent:
            return 0
        now = self._clock()
        for session_id, chunks in sent:
            self._publisher.publish(session_id, chunks)
        lateness = now - np.concatenate([due.chunks.scheduled_at for due in sent])
        self._figures.lateness.add(now, max(0.0, float(lateness.max())))
        self._figures.late += int(np.count_nonzero(lateness > LATE_SECONDS))
        self._meter.chunks(lateness)
        return len(lateness)
