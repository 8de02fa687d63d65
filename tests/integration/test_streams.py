"""Short runs of benchmarks/streams.py against the real process."""

import asyncio

import pytest

from tests.fuzz import streams
from tests.serving import LIGHT, Service

pytestmark = pytest.mark.asyncio(loop_scope="module")


@pytest.fixture(scope="module")
def server():
    with Service(settings=LIGHT | streams.SETTINGS) as server:
        yield server
        assert server.errors == []


async def test_readers_who_leave_leave_nothing_behind(server):
    async with asyncio.timeout(120):
        before, after, stats = await streams.cycles(server.target, count=150, seed=3)
    assert stats["subscribers"] <= 1
    assert after - before < 15, (before, after)  # 100 kB for each of them


@pytest.mark.parametrize("kind", ["grpc", "websocket"])
async def test_a_stalled_reader_costs_the_others_nothing(server, kind):
    async with asyncio.timeout(120):
        stalled = await streams.stall(
            server.target, seconds=5, sessions=2, agents=2, healthy=7, kind=kind
        )
    found = streams.summary(stalled)
    assert found["readers"] == 7
    assert all(reading.chunks > 0 and reading.lost == 0 for reading in stalled.readings), found
