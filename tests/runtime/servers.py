"""Runtimes with fake engines, for a test."""

from tests.runtime.kept_worlds import fake_worlds
from tests.runtime.test_lockstep import until_ready
from wayfarer.runtime.motion_service import MotionService


class Servers:
    """Several at a time, stopped at the end."""

    def __init__(self):
        self.running = []

    async def start(self, journal=None, **settings):
        runtime = MotionService(fake_worlds(journal, **settings))
        runtime.start()
        self.running.append(runtime)
        await until_ready(runtime)
        return runtime

    async def stop(self, runtime):
        self.running.remove(runtime)
        await runtime.stop()
