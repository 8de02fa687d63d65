import pytest

from tests.transport.rig import Rig
from wayfarer.logs import configure_logging


@pytest.fixture(autouse=True, scope="session")
def quiet_logs():
    """Plain lines: structlog's own default prints traces with all local variables, in seconds."""
    configure_logging("warning", "json")


@pytest.fixture
async def rig():
    async with Rig() as running:
        yield running
