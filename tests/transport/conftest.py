import pytest

from tests.transport.fakes import Clock, FakeService, opened
from tests.transport.rig import Rig


@pytest.fixture
async def rig():
    async with Rig() as running:
        yield running


@pytest.fixture
def service():
    return FakeService()


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
async def api(service, clock):
    """A gateway over the fake service that takes work."""
    return await opened(service, clock=clock)
