"""What `wayfarer cluster` asks Ray beside its event loop."""

import subprocess
import sys

import pytest

from wayfarer.errors import InvalidArgument

actors = pytest.importorskip("wayfarer.cluster.actors", exc_type=ImportError)

ENDS = """
import asyncio, time
from wayfarer.cluster.actors import on_daemon
from wayfarer.commands.serve import run

async def work():
    asked = asyncio.create_task(on_daemon(lambda: time.sleep(600)))
    await asyncio.sleep(0.1)
    asked.cancel()
    await asyncio.wait([asked])

run(work())
"""


def test_the_command_ends_while_ray_never_answers():
    done = subprocess.run([sys.executable, "-c", ENDS], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")


async def test_what_ray_refuses_is_told():
    def refuse():
        raise InvalidArgument("no")

    with pytest.raises(InvalidArgument, match="no"):
        await actors.on_daemon(refuse)
