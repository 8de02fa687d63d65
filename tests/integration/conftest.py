import pytest

from tests.runtime.kept_worlds import fake_worlds
from wayfarer.config.limits import Limits
from wayfarer.runtime.live import steady_clock
from wayfarer.runtime.motion_service import MotionService
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.server import Server


@pytest.fixture
async def server():
    """All but the models: the real loop and servers, and an engine that walks."""
    clock = steady_clock()
    worlds = fake_worlds(limits=Limits(agents=32, agents_per_session=32, sessions=4, queue_s=30.0))
    # long queues: a busy test machine must not look like a slow reader
    runtime = MotionService(worlds, clock=clock)
    gateway = Gateway(runtime, BodyLibrary("anny52"), Limits(), clock, stop=lambda: None)
    running = Server(gateway, "127.0.0.1", 0, 0)
    runtime.start()
    await running.start()
    await running.until_ready()
    yield running
    await running.stop()
    await runtime.stop()
