"""The only thread and the only clock: take commands, step agents, publish chunks.

A turn of the loop: serve the inbox → publish what falls due → one engine call → again, or wait
for the next event or command. Frames keep their schedule, so a late turn is followed by bigger
batches, not by later ones. Only when the loop is more than a second behind (an overloaded or
suspended machine) the whole schedule is moved back, and `rebased` in the statistics says so.

An error in a turn is logged and counted, `ready` is false until a turn succeeds again, and the
turn is tried again; after `FAILURES` in a row the loop ends, and with it every stream and command
(Unavailable).
"""

import asyncio
import threading
import time
import weakref
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto

import structlog

from wayfarer.errors import NotFound, Unavailable
from wayfarer.runtime.agent import AgentInfo, AgentSpec, Goal, LoopStats, MotionChunk, SessionInfo
from wayfarer.runtime.inbox import Inbox, post
from wayfarer.runtime.stats import Window, mean, percentile
from wayfarer.runtime.subscription import Batch, ChunkQueue
from wayfarer.runtime.world import World
from wayfarer.spec import FPS

log = structlog.get_logger(__name__)

Delivery = tuple[ChunkQueue, Batch]

ALIVE_SECONDS = 1.0  # without a turn for so long the loop counts as hung
HEARTBEAT = 0.25  # the longest wait, so that an idle loop is seen to be alive
BEHIND_SECONDS = 1.0  # beyond this the schedule is moved
LATE_SECONDS = 1 / FPS  # a chunk that leaves later than one frame after its time is late
MAX_REACH = 0.05  # chunks leave no earlier than this: they can no longer be replanned then
FAILURES = 10  # failed turns in a row that end the loop
RETRY_SECONDS = 0.05  # pause after a failed turn


class Phase(Enum):
    """The life of a loop."""

    NEW = auto()
    WARMING = auto()
    RUNNING = auto()
    ENDED = auto()


@dataclass(frozen=True, slots=True)
class LoopSettings:
    """Bounds of the queues around the loop."""

    inbox: int = 4096  # commands
    queue_seconds: float = 0.5  # motion that a slow subscriber may lag behind


def steady_clock() -> Callable[[], float]:
    """Unix seconds that never jump: the wall clock of now, carried on by the monotonic one."""
    start = time.time() - time.monotonic()
    return lambda: start + time.monotonic()


class MotionLoop:
    """Runs a world in a thread of its own. Implements `MotionService`."""

    def __init__(
        self,
        world: World,
        warm_up: Callable[[], None] = lambda: None,
        settings: LoopSettings | None = None,
        clock: Callable[[], float] | None = None,
    ) -> None:
        """`warm_up` is called on the thread before the first turn."""
        self._world = world
        self._warm_up = warm_up
        self._settings = settings or LoopSettings()
        self._clock = clock or steady_clock()
        self._inbox = Inbox(self._settings.inbox)
        self._phase = Phase.NEW
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="motion-loop", daemon=True)
        self._queues: dict[str, list[weakref.ref[ChunkQueue]]] = defaultdict(list)
        self._started_at = self._beat = self._clock()
        self._failures_in_a_row = 0
        self._failures = self._rebased = self._steps = self._late = 0
        self._step_seconds, self._lateness = Window(), Window()

    # Life

    def start(self) -> None:
        """Start the thread, once."""
        self._phase = Phase.WARMING
        self._thread.start()

    async def stop(self) -> None:
        """End the loop, every stream and every waiting command; return when that is done."""
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

    # Commands

    async def create_session(self, session_id: str | None = None) -> SessionInfo:
        """See `MotionService`, as for all below."""
        return await self._inbox.ask(lambda: self._world.create_session(session_id, self._clock()))

    async def get_session(self, session_id: str) -> SessionInfo:
        """See `MotionService`."""
        return await self._inbox.ask(lambda: self._world.get_session(session_id))

    async def delete_session(self, session_id: str) -> None:
        """See `MotionService`."""
        await self._inbox.ask(lambda: self._delete_session(session_id))

    async def create_agents(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentInfo]:
        """See `MotionService`."""
        # Skinning start poses takes about a millisecond each: not on the motion thread.
        seeds = await asyncio.to_thread(self._world.prepare, specs)
        return await self._inbox.ask(
            lambda: self._world.create_agents(session_id, specs, self._clock(), seeds)
        )

    async def get_agent(self, agent_id: str) -> AgentInfo:
        """See `MotionService`."""
        return await self._inbox.ask(lambda: self._world.get_agent(agent_id))

    async def list_agents(self, session_id: str) -> list[AgentInfo]:
        """See `MotionService`."""
        return await self._inbox.ask(lambda: self._world.list_agents(session_id))

    async def delete_agent(self, agent_id: str) -> None:
        """See `MotionService`."""
        await self._inbox.ask(lambda: self._world.delete_agent(agent_id))

    async def set_goal(self, agent_id: str, goal: Goal) -> int:
        """See `MotionService`."""
        return await self._inbox.ask(lambda: self._world.set_goal(agent_id, goal, self._clock()))

    async def set_path(self, agent_id: str, goals: Sequence[Goal]) -> int:
        """See `MotionService`."""
        return await self._inbox.ask(lambda: self._world.set_path(agent_id, goals, self._clock()))

    async def clear_goal(self, agent_id: str) -> int:
        """See `MotionService`."""
        return await self._inbox.ask(lambda: self._world.clear_goal(agent_id, self._clock()))

    async def subscribe(self, session_id: str, agent_ids: Sequence[str] = ()) -> ChunkQueue:
        """See `MotionService`. A queue that is let go without `close` is forgotten, too."""
        queue = ChunkQueue(session_id, frozenset(agent_ids), self._settings.queue_seconds)
        await self._inbox.ask(lambda: self._add_queue(queue))
        return queue

    async def stats(self) -> LoopStats:
        """See `MotionService`."""
        return await self._inbox.ask(self._stats)

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
        self._end_queues(list(self._queues), None if self._stopping else Unavailable(reason))

    def _try_turn(self) -> None:
        try:
            self._turn()
            self._failures_in_a_row = 0
        except Exception as error:
            self._failures += 1
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
        now = self._beat = self._clock()
        behind = self._world.behind(now)
        if behind > BEHIND_SECONDS:
            self._world.rebase(behind)
            self._rebased += 1
            log.warning("the motion loop is behind; schedule moved", seconds=round(behind, 3))
        event = self._world.next_event()
        wait = HEARTBEAT if event is None else min(max(event - now, 0.0), HEARTBEAT)
        self._inbox.serve(wait)

        started = self._clock()
        # What falls due during the engine call leaves before it, rather than late.
        event = self._world.next_event()
        busy = event is not None and event <= started
        self._publish(self._world.collect(started + (self._reach() if busy else 0.0)))
        stepped = self._world.step(started) if busy else 0
        if stepped:
            done = self._clock()
            self._steps += stepped
            self._step_seconds.add(done, done - started)
            self._world.spent(done, done - started)

    def _reach(self) -> float:
        """How long the next engine call may take: the longest of the last seconds, capped."""
        return min(max(self._step_seconds.values(self._clock()), default=0.0), MAX_REACH)

    # Streams

    def _add_queue(self, queue: ChunkQueue) -> None:
        unknown = queue.agent_ids - set(self._world.get_session(queue.session_id).agent_ids)
        if unknown:
            raise NotFound(f"no agents {sorted(unknown)} in session {queue.session_id!r}")
        self._queues[queue.session_id].append(weakref.ref(queue))

    def _publish(self, chunks: list[MotionChunk]) -> None:
        if not chunks:
            return
        now = self._clock()
        by_session: dict[str, list[MotionChunk]] = defaultdict(list)
        for chunk in chunks:
            late = max(now - chunk.scheduled_at, 0.0)
            self._lateness.add(now, late)
            self._late += late > LATE_SECONDS
            by_session[self._world.session_of(chunk.agent_id)].append(chunk)
        deliveries: dict[asyncio.AbstractEventLoop, list[Delivery]] = defaultdict(list)
        for session_id, batch in by_session.items():
            for queue in self._open_queues(session_id):
                ids = queue.agent_ids
                wanted = [c for c in batch if c.agent_id in ids] if ids else batch
                if wanted:
                    deliveries[queue.loop].append((queue, wanted))
        for loop, delivery in deliveries.items():
            post(loop, _deliver, delivery)

    def _open_queues(self, session_id: str) -> list[ChunkQueue]:
        """Those of a session; closed and vanished ones are forgotten here."""
        found = [ref() for ref in self._queues.get(session_id, ())]
        kept = [q for q in found if q is not None and not (q.closed or q.loop.is_closed())]
        if len(kept) < len(found):
            self._queues[session_id] = [weakref.ref(q) for q in kept]
        return kept

    def _delete_session(self, session_id: str) -> None:
        self._world.delete_session(session_id)
        self._end_queues([session_id], None)

    def _end_queues(self, session_ids: list[str], error: Unavailable | None) -> None:
        for session_id in session_ids:
            for queue in self._open_queues(session_id):
                post(queue.loop, queue.end, error)
            self._queues.pop(session_id, None)

    def _stats(self) -> LoopStats:
        now = self._clock()
        steps = [1e3 * s for s in self._step_seconds.values(now)]
        queues = [q for session_id in list(self._queues) for q in self._open_queues(session_id)]
        return LoopStats(
            agents=self._world.agents,
            sessions=self._world.sessions,
            subscribers=len(queues),
            steps=self._steps,
            step_ms_mean=mean(steps),
            step_ms_p95=percentile(steps, 95),
            late_chunks=self._late,
            lateness_ms_p95=1e3 * percentile(self._lateness.values(now), 95),
            uptime_s=now - self._started_at,
            resets=self._world.resets,
            failures=self._failures,
            rebased=self._rebased,
            dropped_batches=sum(q.dropped for q in queues),
            reduced_steps=self._world.reduced_steps,
        )


def _deliver(deliveries: list[Delivery]) -> None:
    for queue, batch in deliveries:
        queue.put(batch)
