import pytest

from tests.transport.rig import Rig


@pytest.fixture
async def rig():
    async with Rig() as running:
        yield running
