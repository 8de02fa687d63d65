"""The loop with its real thread, for a test."""

import asyncio
import threading

from tests.world.fakes import make_world
from wayfarer.service.live import LiveMotion, LoopSettings
from wayfarer.service.streams.publications import StreamOptions
from wayfarer.world.limits import Limits

ALL = StreamOptions()


class Running:
    """`async with Running() as loop`: started, ready, and stopped at the end."""

    def __init__(self, engine=None, meter=None, limits=None, **settings):
        world = make_world(engine, limits=limits or Limits())
        self.loop = LiveMotion(world, settings=LoopSettings(**settings), meter=meter)

    async def __aenter__(self):
        self.loop.start()
        await until(lambda: self.loop.ready)
        return self.loop

    async def __aexit__(self, *_):
        await self.loop.stop()
        assert "motion-loop" not in {t.name for t in threading.enumerate()}


async def until(condition, seconds=5.0):
    async with asyncio.timeout(seconds):
        while not condition():
            await asyncio.sleep(0.005)


async def first(queue, count):
    async with asyncio.timeout(5):
        return [await anext(queue) for _ in range(count)]
