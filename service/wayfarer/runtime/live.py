"""Calls of transports become commands to the thread that owns a world.

In real time `MotionThread` steps the `World` and hands its chunks to the `Publisher`; in lock-step
`LockStepThread` does, on request.
"""

import asyncio
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import groupby
from operator import attrgetter
from typing import Protocol, TypeVar

import structlog

from wayfarer.errors import FailedPrecondition, NotFound, ResourceExhausted, WayfarerError
from wayfarer.runtime.inbox import Inbox
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.persistence.capture import capture_planned
from wayfarer.runtime.persistence.session_record import CapturedSession, SessionCopy
from wayfarer.runtime.streams.publications import StreamOptions, model_changed
from wayfarer.runtime.streams.publisher import Publisher
from wayfarer.runtime.streams.subscription import Subscription
from wayfarer.world.agents.agent import AgentInfo, AgentSpec, SessionInfo, SessionSpec
from wayfarer.world.agents.faults import Stage
from wayfarer.world.agents.records import SessionRecord
from wayfarer.world.agents.slots import Motion
from wayfarer.world.world import World

log = structlog.get_logger(__name__)

T = TypeVar("T")
U = TypeVar("U")


def steady_clock() -> Callable[[], float]:
    """Unix seconds that never jump: the wall clock at the start, then the monotonic clock."""
    start = time.time() - time.monotonic()
    return lambda: start + time.monotonic()


class WorldThread(Protocol):
    """The thread that owns a world: it serves the inbox, and lets time pass."""

    inbox: Inbox

    @property
    def publisher(self) -> Publisher:
        """Gets what the world sends."""
        ...

    @property
    def clock(self) -> Callable[[], float]:
        """Unix seconds, as the world sees them."""
        ...

    def start(self) -> None:
        """Starts the thread, once."""
        ...

    async def stop(self) -> None:
        """Ends the thread, every stream and every waiting command; returns when that is done."""
        ...


class LiveMotion:
    """Sessions that live in a world, in real time or in lock-step."""

    def __init__(
        self,
        world: World,
        thread: WorldThread,
        meter: MetricsSink | None = None,
        keep_aside: Callable[[str], None] = lambda session_id: None,
        spawn_pool: ThreadPoolExecutor | None = None,
    ) -> None:
        """`keep_aside(session)` keeps a removed session's files on disk. `spawn_pool`: one thread
        for costly calls, which several worlds may share.
        """
        self._keep_aside = keep_aside
        self._world = world
        self._thread = thread
        self._clock, self._inbox, self._publisher = thread.clock, thread.inbox, thread.publisher
        self._meter = meter or MetricsSink()
        self._spawn_pool = spawn_pool or ThreadPoolExecutor(1, "spawn")

    # Life

    def start(self) -> None:
        """Starts the thread, once."""
        self._thread.start()

    async def stop(self) -> None:
        """Ends the thread, every stream and every waiting command; returns when that is done."""
        await self._thread.stop()
        self._spawn_pool.shutdown(wait=False, cancel_futures=True)

    async def ask(self, call: Callable[[World, float], T]) -> T:
        """Runs `call` on the thread, with world and time. `call` must be quick.

        Raises Unavailable, or what `call` raises.
        """
        return await self._inbox.ask(lambda: call(self._world, self._clock()))

    # Sessions

    async def create_session(self, spec: SessionSpec, at: float | None = None) -> SessionInfo:
        """See `MotionService`. `at`: Unix seconds; None: the world's time."""
        with self._counted("create_session"):
            return await self.ask(
                lambda world, now: world.create_session(spec, now if at is None else at)
            )

    async def put_session(self, record: SessionRecord) -> SessionInfo:
        """Resumes a session from another server; see `Membership.put_session`."""
        with self._counted("import_session"):
            await self._off_thread(self._world.members.examine, record)
            return await self.ask(lambda *_: self.adopt(record, examined=True))

    async def delete_session(self, session_id: str, error: WayfarerError | None = None) -> None:
        """Ends a session; its streams end after their last chunks, with `error` if it is given."""
        await self.ask(lambda *_: self._delete_session(session_id, error))

    # Agents

    async def create_agents(
        self, session_id: str, specs: Sequence[AgentSpec], names: Sequence[str] = ()
    ) -> list[AgentInfo]:
        """See `MotionService`."""
        # A lack of room is reported at once, even if the motion thread is busy. Skinning start
        # poses takes about a millisecond each, so it does not run on the motion thread.
        with (
            self._counted("create_agents"),
            self._world.reserve(session_id, specs, self._clock()) as room,
        ):
            place = partial(self._world.placed, session_id)
            placed = await self._off_thread(place, specs)
            seeds = await self._off_thread(self._prepare, placed)
            return await self.ask(
                lambda world, now: world.create_agents(session_id, placed, now, seeds, room, names)
            )

    async def delete_agent(self, agent_id: str) -> None:
        """See `MotionService`."""
        await self.ask(lambda *_: self._delete_agent(agent_id))

    async def use_model(self, name: str) -> int:
        """Moves all agents with a loaded model; returns how many had another. Raises NotFound."""
        return await self.ask(lambda *_: self._use_model(name))

    # Moves to another server; see moving.py

    async def send_rest(self, session_id: str) -> None:
        """Sends everything planned for a session's agents, before its time. Raises NotFound."""
        await self.ask(lambda world, _: self._send_rest(world, session_id))

    async def taken(self, session_id: str) -> CapturedSession:
        """The state of a frozen session for another server. Raises NotFound."""
        return await self.ask(
            lambda world, _: capture_planned(world, session_id)._replace(
                log=self._publisher.log_of(session_id)
            )
        )

    async def put_live(self, session: SessionCopy, admit: bool) -> SessionInfo:
        """Adds a session from another server, still frozen; see `Membership.put_session`."""
        with self._counted("import_session"):
            await self._off_thread(self._world.members.examine, session.record)
            return await self.ask(lambda world, now: self._put_live(world, session, now, admit))

    # Streams

    async def subscribe(self, session_id: str, options: StreamOptions) -> Subscription:
        """See `MotionService`. A subscription dropped without `close` is forgotten too."""
        subscription = Subscription(
            session_id, options, self._world.settings.limits, self._meter, self._clock
        )
        await self.ask(lambda _, now: self._subscribe(subscription, now))
        return subscription

    # Private

    @contextmanager
    def _counted(self, command: str) -> Iterator[None]:
        try:
            yield
        except ResourceExhausted:
            self._meter.refusal(command)
            raise

    def _prepare(self, specs: Sequence[AgentSpec]) -> list[Motion]:
        """Makes seeds for new agents; other threads that wait to run Python go first."""
        seeds: list[Motion] = []
        for spec in specs:
            seeds += self._world.prepare([spec])
            time.sleep(0)
        return seeds

    async def _off_thread(self, call: Callable[[U], T], argument: U) -> T:
        """Makes a costly call in the one worker thread.

        With several threads, calls would only prevent each other, and event loops, from running
        Python.
        """
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._spawn_pool, call, argument)

    # For callers with the world to themselves, such as its thread

    def await_goal(self, agent_id: str, revision: int, since: float) -> None:
        """Starts to measure the time until the first chunk of a goal."""
        session_id = self._world.session_of(agent_id)
        self._publisher.await_goal(session_id, agent_id, revision, since)

    def adopt(
        self, record: SessionRecord, admit: bool = True, examined: bool = False
    ) -> SessionInfo:
        """Resumes a session of another server or of the journal; see `Membership.put_session`."""
        session = self._world.members.put_session(record, self._clock(), admit, examined)
        self._publisher.adopt(record)
        return session.info()

    def set_aside(self, session_id: str, why: str) -> None:
        """Removes a session that cannot continue; `why` is one of `SET_ASIDE`."""
        log.error("a session is set aside: it cannot go on", session=session_id, why=why)
        self._meter.set_aside(why)
        self._keep_aside(session_id)
        error = FailedPrecondition(
            f"session {session_id!r} was set aside: an error in the server came again and again"
        )
        try:
            self._delete_session(session_id, error)
        except Exception as problem:  # at least it gets no more turns
            self._world.faults.nobody(Stage.SCHEDULE, problem)
            self._world.freeze_all(session_id)

    def _use_model(self, name: str) -> int:
        moved, now = self._world.use_model(name), self._clock()
        by_session = attrgetter("session_id")
        for session_id, agents in groupby(sorted(moved, key=by_session), by_session):
            self._publisher.tell(session_id, [model_changed(agent, now) for agent in agents])
        return len(moved)

    def _delete_agent(self, agent_id: str) -> None:
        session_id = self._world.session_of(agent_id)
        self._world.delete_agent(agent_id)
        self._publisher.forget_agent(session_id, agent_id)

    def _delete_session(self, session_id: str, error: WayfarerError | None = None) -> None:
        self._world.delete_session(session_id)
        self._publisher.end(session_id, error)

    def _send_rest(self, world: World, session_id: str) -> None:
        for due in world.take_rest(session_id):
            self._publisher.publish(due.session_id, due.chunks, ahead=True)
        self._publisher.flush()

    def _put_live(self, world: World, session: SessionCopy, now: float, admit: bool) -> SessionInfo:
        record, put = session.record, world.members.put_session
        made = put(record, now, admit, examined=True, live=session.rows)
        world.members.freeze(made, True)
        if session.log is not None:
            self._publisher.restore(record.session_id, session.log)
        else:
            self._publisher.adopt(record)
        if session.crowd is not None:
            world.crowds.put(record.session_id, session.crowd)
        return made.info()

    def _subscribe(self, subscription: Subscription, now: float) -> None:
        session = self._world.get_session(subscription.session_id)
        if unknown := subscription.agent_ids - set(session.agent_ids):
            raise NotFound(f"no agents {sorted(unknown)} in session {session.session_id!r}")
        self._publisher.subscribe(subscription, now)
