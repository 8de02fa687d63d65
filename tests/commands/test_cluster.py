"""What `wayfarer cluster` asks Ray beside its event loop."""

import asyncio
import sys
from types import SimpleNamespace

import pytest

from tests.programs import run_program
from wayfarer.commands import cluster
from wayfarer.config.settings import Settings
from wayfarer.errors import InvalidArgument

actors = pytest.importorskip("wayfarer.cluster.actors", exc_type=ImportError)

ENDS = """
import asyncio, time
from wayfarer.cluster.actors import on_daemon
from wayfarer.process.event_loop import run

async def work():
    asked = asyncio.create_task(on_daemon(lambda: time.sleep(600)))
    await asyncio.sleep(0.1)
    asked.cancel()
    await asyncio.wait([asked])

run(work())
"""


def test_the_command_ends_while_ray_never_answers():
    assert run_program(sys.executable, "-c", ENDS, timeout=60).stderr == ""


async def test_what_ray_refuses_is_told():
    def refuse():
        raise InvalidArgument("no")

    with pytest.raises(InvalidArgument, match="no"):
        await actors.on_daemon(refuse)


@pytest.mark.parametrize(("asked", "ports"), [(0, (0, 0)), (9000, (9000, 9001))])
async def test_nodes_of_all_machines_take_the_ports_that_were_asked_for(asked, ports):
    kept = {}
    ray = SimpleNamespace(
        machines=lambda: {"a" * 40: "127.0.0.1", "b" * 40: "127.0.0.2"},
        keep=lambda plan, serve, machine: kept.update({machine: plan.settings}),
    )
    async with cluster._covered(ray, Settings(), asked), asyncio.timeout(5):
        while len(kept) < 2:
            await asyncio.sleep(0.01)
    assert {(one.http_port, one.grpc_port) for one in kept.values()} == {ports}
