import pytest

import wayfarer_client as wf
from tests.clients.cluster import RunningCluster
from tests.clients.fake_server import FakeServer
from tests.clients.local_traces import both_ways
from tests.clients.replies import new_session
from tests.serving import Service


@pytest.fixture(scope="package")
def real_server():
    """The shipped model; one server for all clients."""
    with Service() as running:
        yield running


@pytest.fixture(scope="package")
def cluster():
    """An entry with two nodes; one for all clients."""
    with RunningCluster() as running:
        yield running


@pytest.fixture(scope="session")
def drawn():
    """The server's chunks of a trace, for the ports of its rules."""
    return both_ways()


@pytest.fixture
async def server():
    async with FakeServer() as running:
        running.answers["CreateSession"] = new_session
        yield running


@pytest.fixture
async def client(server):
    async with wf.Client(server.address) as connected:
        yield connected
