"""The loop with its real thread, for a test."""

import asyncio
import threading
import time

from tests.world.fakes import FakeEngine, make_world
from wayfarer.config.limits import Limits
from wayfarer.runtime.inbox import Inbox
from wayfarer.runtime.live import LiveMotion, steady_clock
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.motion_service import INBOX
from wayfarer.runtime.pipeline import EnginePipeline
from wayfarer.runtime.streams.publications import StreamOptions
from wayfarer.runtime.streams.publisher import Publisher
from wayfarer.runtime.thread import MotionThread

ALL = StreamOptions()


class Loop(LiveMotion):
    """A world in real time, as `MotionService` has it."""

    def __init__(self, world, *, clock=None, meter=None, **options):
        clock, meter, inbox = clock or steady_clock(), meter or MetricsSink(), Inbox(INBOX)
        thread = MotionThread(
            world=world,
            publisher=Publisher(world.settings.limits, meter, world.get_agent, world.faults),
            inbox=inbox,
            pipeline=EnginePipeline(clock, inbox.wake),
            clock=clock,
            meter=meter,
            **{"warm_up": lambda: None} | options,
        )
        super().__init__(world, thread, meter)

    ready = property(lambda self: self._thread.ready)
    alive = property(lambda self: self._thread.alive)
    failed = property(lambda self: self._thread.failed)

    async def stats(self):
        return await self.ask(lambda *_: self._thread.stats())


class Running:
    """`async with Running() as loop`: started, ready, and stopped at the end."""

    def __init__(self, engine=None, meter=None, **limits):
        self.loop = Loop(make_world(engine, limits=Limits(**limits)), meter=meter)

    async def __aenter__(self):
        self.loop.start()
        await until(lambda: self.loop.ready)
        return self.loop

    async def __aexit__(self, *_):
        await self.loop.stop()
        assert "motion-loop" not in {t.name for t in threading.enumerate()}


class FastTime:
    """The clock of a live service. It runs `speed` times as fast while the motion thread waits for
    the next moment, and stops while the thread or its engine works: however busy the machine is,
    nothing is late.
    """

    def __init__(self, speed: float = 8.0) -> None:
        self._speed, self._now = speed, time.time()

    def __call__(self) -> float:
        return self._now

    def drive(self, live: LiveMotion) -> None:
        inbox, pipeline = live._inbox, live._thread._pipeline
        serve = inbox.serve

        def wait(seconds: float) -> None:
            began = time.monotonic()
            serve(seconds / self._speed)
            if pipeline.is_idle:
                self._now += min(seconds, (time.monotonic() - began) * self._speed)

        inbox.serve = wait


class HeldEngine(FakeEngine):
    """Its calls last until they are released."""

    def __init__(self) -> None:
        super().__init__()
        self.let_go, self.is_busy = threading.Event(), threading.Event()

    def step(self, gender, inputs):
        self.is_busy.set()
        self.let_go.wait(30)
        return super().step(gender, inputs)


async def until(condition, seconds=30.0):
    async with asyncio.timeout(seconds):
        while not condition():
            await asyncio.sleep(0.005)


async def first(queue, count):
    async with asyncio.timeout(5):
        return [await anext(queue) for _ in range(count)]


def give(loop, agent_id, goal):
    """The revision of a goal, whose first chunk is awaited."""

    def given(world, now):
        revision = world.give(agent_id, goal, now)
        loop.await_goal(agent_id, revision, now)
        return revision

    return loop.ask(given)


def world_of(loop, method, *arguments):
    """The result of a method of the loop's world."""
    return loop.ask(lambda world, _: getattr(world, method)(*arguments))
