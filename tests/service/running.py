"""The loop with its real thread, for a test."""

import asyncio
import threading

from tests.world.fakes import FakeEngine, make_world
from wayfarer.limits import Limits
from wayfarer.service.live import LiveMotion
from wayfarer.service.streams.publications import StreamOptions

ALL = StreamOptions()


class Running:
    """`async with Running() as loop`: started, ready, and stopped at the end."""

    def __init__(self, engine=None, meter=None, **limits):
        self.loop = LiveMotion(make_world(engine, limits=Limits(**limits)), meter=meter)

    async def __aenter__(self):
        self.loop.start()
        await until(lambda: self.loop.ready)
        return self.loop

    async def __aexit__(self, *_):
        await self.loop.stop()
        assert "motion-loop" not in {t.name for t in threading.enumerate()}


class HeldEngine(FakeEngine):
    """Its calls last until they are let go."""

    def __init__(self) -> None:
        super().__init__()
        self.let_go, self.is_busy = threading.Event(), threading.Event()

    def step(self, gender, inputs):
        self.is_busy.set()
        self.let_go.wait(30)
        return super().step(gender, inputs)


async def until(condition, seconds=5.0):
    async with asyncio.timeout(seconds):
        while not condition():
            await asyncio.sleep(0.005)


async def first(queue, count):
    async with asyncio.timeout(5):
        return [await anext(queue) for _ in range(count)]


def world_of(loop, method, *arguments):
    """What a method of the loop's world gives."""
    return loop.ask(lambda world, _: getattr(world, method)(*arguments))
