import pytest

from tests.transport.fakes import FakeService, opened
from tests.transport.rig import Rig
from tests.transport.samples import NOW
from tests.world.fakes import ManualClock


@pytest.fixture
async def rig():
    async with Rig() as running:
        yield running


@pytest.fixture
def service():
    return FakeService()


@pytest.fixture
def clock():
    return ManualClock(NOW)


@pytest.fixture
async def api(service, clock):
    """A gateway over the fake service that takes work."""
    return await opened(service, clock=clock)
