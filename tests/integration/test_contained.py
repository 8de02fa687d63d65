"""The process ends when its motion loop has ended.

Without the models: an engine that walks. The real ways, streams, probes and metrics.
"""

import asyncio
import sys

import pytest

from tests.runtime.kept_worlds import fake_worlds
from wayfarer.commands.serve import SIGNALS, serve
from wayfarer.config.settings import Settings
from wayfarer.errors import Unavailable
from wayfarer.runtime.motion_service import MotionService
from wayfarer.runtime.thread import MotionThread


async def test_a_loop_that_has_ended_ends_the_process(monkeypatch):
    """A supervisor can then restart it, instead of 503 forever."""

    def runtime(settings, folder, clock, meter, ownership, ended):
        return MotionService(fake_worlds(), clock=clock, meter=meter, ended=ended)

    def fail(self, now):
        raise RuntimeError("a turn that fails for everybody")

    for name in ("settle", "share_heaps"):
        monkeypatch.setattr(f"wayfarer.commands.serve.{name}", lambda: None)
    monkeypatch.setattr("wayfarer.commands.serve.runtime", runtime)
    interval, loop = sys.getswitchinterval(), asyncio.get_running_loop()
    try:
        running = asyncio.create_task(serve(Settings(http_port=0, grpc_port=0)))
        await asyncio.sleep(1.0)
        assert not running.done()
        monkeypatch.setattr(MotionThread, "_keep_schedule", fail)
        with pytest.raises(Unavailable, match="the motion loop has failed, and the server ends"):
            async with asyncio.timeout(30):
                await running
    finally:
        sys.setswitchinterval(interval)
        for sign in SIGNALS:
            loop.remove_signal_handler(sign)
