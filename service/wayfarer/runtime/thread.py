"""The motion thread: takes commands, schedules steps, applies them, publishes chunks.

The engine works beside the thread (`pipeline.py`). Frames keep their schedule, so a late turn is
followed by larger batches, not by later frames. On an overloaded or suspended machine, primitives
that can no longer be seen in time are not made: their agents continue a whole number of
primitives later, and all time goes to the others. `skipped_steps` counts these primitives.

An error of one agent or session is contained to it (`world/agents/faults.py`). Any other error in a
turn is logged and counted; `ready` is false until a turn succeeds again, and the turn is retried.
After `FAILURES` in a row the thread ends, and with it every stream and command (Unavailable). Then
the process ends, so that its supervisor restarts it.
"""

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import Enum, auto
from functools import partial
from typing import Final

import structlog

from wayfarer.errors import Unavailable
from wayfarer.runtime.inbox import Inbox
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.pipeline import EnginePipeline
from wayfarer.runtime.stats import LoopStats, ThreadFigures
from wayfarer.runtime.streams.publisher import Publisher
from wayfarer.spec import FPS
from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.faults import MAX_FAULTS, Stage
from wayfarer.world.agents.views import agents_by_sight, agents_by_state
from wayfarer.world.events import Event, EventKind
from wayfarer.world.stepping.due import Due, sights_of
from wayfarer.world.stepping.engine_call import PendingStep
from wayfarer.world.world import World

log = structlog.get_logger(__name__)

ALIVE_SECONDS: Final = 1.0  # without a turn for this long the thread counts as hung
HEARTBEAT: Final = 0.25  # the longest wait, so that an idle thread is seen to be alive
LOG_INTERVAL_S: Final = 1.0  # minimum time between two logs of skipped steps
EARLY_SECONDS: Final = 1 / FPS  # chunks leave this long before their time, rather than late
BETWEEN_SECONDS: Final = 0.02
"""Minimum time between publications: otherwise every session would have a message for each engine
call. Chunks that are in time leave in rounds that are farther apart than this anyway.
"""

LEAVING_SECONDS: Final = 0.03
"""Time from the end of a turn until its chunks have arrived: a primitive that is over by then is
skipped. Otherwise an overloaded server would show most primitives just when they are over.
"""

HOLD_SECONDS: Final = 0.5  # from a turn, by which agents that wait are postponed
FAILURES: Final = 10  # failed turns in a row that end the thread
RETRY_SECONDS: Final = 0.05  # pause after a failed turn
PAUSED_SECONDS: Final = 0.02  # between checks whether it may step again
VITAL: Final = frozenset((Stage.PUBLICATION, Stage.EVENT))
"""Stages without which no reader sees a session."""


class Phase(Enum):
    """The life of the thread."""

    NEW = auto()
    WARMING = auto()
    RUNNING = auto()
    ENDED = auto()


class MotionThread:
    """Steps a world, in a separate thread."""

    def __init__(
        self,
        *,
        world: World,
        publisher: Publisher,
        inbox: Inbox,
        pipeline: EnginePipeline,
        warm_up: Callable[[], None],
        clock: Callable[[], float],
        meter: MetricsSink,
        may_step: Callable[[], bool] = lambda: True,
        set_aside: Callable[[str], None] = lambda session_id: None,
        ended: Callable[[], None] = lambda: None,
    ) -> None:
        """`warm_up` is called on the thread before the first turn. While `may_step()` is false
        (`Ownership`), nothing is stepped or sent; commands are still served. `set_aside(session)`
        takes out a session that fails turn after turn. `ended()` is called when the thread ends
        without having been stopped.
        """
        self._world = world
        self.publisher = publisher
        self.inbox = inbox
        self._warm_up = warm_up
        self.clock = clock
        self._may_step = may_step
        self._set_aside = set_aside
        self._on_end = ended
        self._phase = Phase.NEW
        self._stopping = self._failed = False
        self._pipeline = pipeline
        self._thread = threading.Thread(target=self.run, name="motion-loop", daemon=True)
        self._started_at = self._beat = clock()
        self._failures_in_a_row = 0
        self._logged_at = float("-inf")  # when skipped steps were logged last
        self._publish_at = float("-inf")  # the earliest time of the next publication
        self._figures = ThreadFigures(meter)

    def start(self) -> None:
        """Starts the thread, once."""
        self._phase = Phase.WARMING
        self._thread.start()

    async def stop(self) -> None:
        """Ends the thread, every stream and every waiting command; returns when that is done."""
        self._stopping = True
        self.inbox.wake()
        if self._thread.is_alive():
            await asyncio.to_thread(self._thread.join)

    @property
    def ready(self) -> bool:
        """Whether it is warm and running, and the last turn succeeded."""
        return self._phase is Phase.RUNNING and self._failures_in_a_row == 0

    @property
    def failed(self) -> bool:
        """Whether it has ended because of an error."""
        return self._failed

    @property
    def alive(self) -> bool:
        """Whether it warms up, or has begun a turn within the last second and no engine call takes
        longer than that.
        """
        if self._phase is Phase.WARMING:
            return self._thread.is_alive()
        now = self.clock()
        is_stalled = now - self._beat >= ALIVE_SECONDS or self._pipeline.age(now) >= ALIVE_SECONDS
        return self._phase is Phase.RUNNING and not is_stalled

    def stats(self) -> LoopStats:
        """Must be called on the thread."""
        now, world = self.clock(), self._world
        open_ = list(self.publisher.open())
        return LoopStats(
            agents=len(world.registry.agents),
            sessions=len(world.registry.sessions),
            subscribers=len(open_),
            uptime_s=now - self._started_at,
            resets=world.scheduler.resets,
            mended_steps=world.scheduler.mended_steps,
            dropped_batches=sum(subscription.dropped for subscription in open_),
            reduced_steps=world.scheduler.reduced_steps,
            states=agents_by_state(world.slots),
            sights=agents_by_sight(world.slots),
            capacity=world.load.capacity(now),
            load=world.load.admission.load(now),
            degradation_level=world.load.level_number,
            held_steps=world.scheduler.unstepped.held_steps,
            coasted_steps=world.scheduler.unstepped.coasted_steps,
            refused_agents=world.load.admission.refused,
            **self._figures.values(now),
        )

    def _turn(self, now: float) -> int:
        """Applies completed engine calls, schedules and runs due steps, publishes.

        Returns how many engine calls were applied.
        """
        self._keep_schedule(now)  # first: overdue chunks are rescheduled, not sent late
        self._forget(self._world.crowds.tend(now), now)
        applied = 0
        for step, seconds in self._pipeline.completed():
            self._apply(step, seconds)
            applied += 1
        self._schedule(now)
        self._publish()
        for session_id in self._world.faults.take_condemned():
            self._set_aside(session_id)
        return applied

    # The parts of a turn

    def _forget(self, left: list[Agent], now: float) -> None:
        for agent in left:
            event = Event(EventKind.AGENT_LEFT, now, agent.agent_id, agent.alias)
            with self._contained(agent.session_id, Stage.EVENT):
                self.publisher.forget_agent(agent.session_id, agent.agent_id)
                self.publisher.tell(agent.session_id, [event])

    def _apply(self, step: PendingStep, seconds: float) -> None:
        agents, now = self._world.apply(step), self.clock()
        self._world.load.spent(now, step, seconds)
        self._figures.stepped(now, seconds, agents)

    def _schedule(self, now: float) -> None:
        """Keeps the engine busy while agents are due."""
        while self._pipeline.has_room and self._is_due(now):
            if not self._pipeline.submit(partial(self._world.schedule, now)):
                break

    def _publish(self) -> None:
        if not self._may_step():  # the lease has ended during this turn: the machine was suspended
            return
        began = self.clock()
        if began < self._publish_at:
            return
        self._leave_out(began)  # the turn may have taken long
        due = self._world.take_due(began + EARLY_SECONDS)
        now = self.clock()
        if due:
            self._publish_at = began + BETWEEN_SECONDS
        sights = sights_of(
            due, self._world.slots
        )  # taken before publishing changes them: they decided the order
        for one in due:
            self._publish_one(one)
        self._figures.published(now, due, sights)
        for session_id, event in self._world.take_events():
            with self._contained(session_id, Stage.EVENT):
                self.publisher.tell(session_id, [event])
        self.publisher.flush()

    def _publish_one(self, due: Due) -> None:
        session_id, chunks, slots = due
        try:
            self.publisher.publish(session_id, chunks)
            self._world.faults.succeeded(session_id, Stage.PUBLICATION)
        except Exception as error:
            self._fault(session_id, Stage.PUBLICATION, error)
        try:
            self._world.see(session_id, slots, self.publisher.sights(session_id, chunks))
        except Exception as error:
            self._fault(session_id, Stage.SIGHT, error)

    def _fault(self, session_id: str, stage: Stage, error: Exception) -> None:
        """Handles a session's fault; a session that fails turn after turn is removed."""
        faults = self._world.faults
        if faults.session(session_id, stage, error) >= MAX_FAULTS and stage in VITAL:
            faults.condemn(session_id)

    @contextmanager
    def _contained(self, session_id: str, stage: Stage) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            self._fault(session_id, stage, error)

    def _is_due(self, now: float) -> bool:
        event = self._world.next_event()
        return event is not None and event <= now

    # Around the turns: commands, schedule, figures, failures

    def run(self) -> None:
        """The thread, from the warm-up to its end."""
        reason = "the motion loop has been stopped"
        try:
            self._warm_up()
            self._beat = self.clock()
            self.inbox.open()  # before RUNNING: a caller may call as soon as `ready` is true
            self._phase = Phase.RUNNING
            while not self._stopping:
                try:
                    self._measured_turn()
                except Exception as error:
                    self._note_failure(error)
                    if self._failures_in_a_row >= FAILURES:
                        raise
                    time.sleep(RETRY_SECONDS)
        except Exception as error:
            reason = f"the motion loop has failed: {error}"
            log.exception("motion loop ended")
            self._failed = True
        self._pipeline.close()
        self._phase = Phase.ENDED
        self.inbox.close(reason)
        self.publisher.end_all(None if self._stopping else Unavailable(reason))
        if self._failed:
            self._on_end()

    def _measured_turn(self) -> None:
        self._beat = self.clock()
        self.inbox.serve(self._time_to_wait())
        now = self.clock()
        if not self._may_step():
            return
        applied = self._turn(now)
        self._figures.worked += self.clock() - now
        if applied:
            self._world.load.admission.worked(now, *self._figures.take_worked())
        if applied or self._pipeline.is_idle:
            self._failures_in_a_row = 0

    def _time_to_wait(self) -> float:
        """Seconds until there is something to do, apart from commands."""
        if not self._may_step():
            return PAUSED_SECONDS
        if self._pipeline.has_completed:
            return 0.0
        event = self._world.next_event(self._pipeline.has_room, EARLY_SECONDS)
        if event is None:
            return HEARTBEAT
        return min(max(max(event, self._publish_at) - self.clock(), 0.0), HEARTBEAT)

    def _keep_schedule(self, now: float) -> None:
        """Postpones agents that are too late or wait for a slow reader."""
        waiting = self.publisher.waiting_sessions(now)
        self._figures.held = len(waiting)
        for session_id in waiting:
            with self._contained(session_id, Stage.SCHEDULE):
                self._world.hold(session_id, now + HOLD_SECONDS)
        self._leave_out(now)

    def _leave_out(self, now: float) -> None:
        """Postpones agents whose primitives are over, so that none is sent late."""
        by_sight = self._world.skip(now + LEAVING_SECONDS)
        if skipped := int(by_sight.sum()):
            self._figures.skipped += by_sight
            if now - self._logged_at >= LOG_INTERVAL_S:
                self._logged_at = now
                log.warning("primitives are left out: the motion loop is behind", steps=skipped)

    def _note_failure(self, error: Exception) -> None:
        self._figures.failures += 1
        self._failures_in_a_row += 1
        log.error(
            "a turn of the motion loop failed",
            error=repr(error),
            in_a_row=self._failures_in_a_row,
            exc_info=self._failures_in_a_row == 1,  # ten equal tracebacks help nobody
        )
