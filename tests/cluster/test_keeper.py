"""A node's process, played by a few lines of Python that speak as one."""

import asyncio
import os
import signal
import sys

import pytest

from tests.cluster.local import Link
from tests.transport.rig import until
from wayfarer.cluster import keeper as keepers
from wayfarer.cluster.keeper import NodeKeeper
from wayfarer.cluster.messages import NodePlan
from wayfarer.config import Settings

HEAD = """
import json, os, signal, sys, time
name = json.loads(sys.stdin.readline())["name"]
def call(number=1):
    print(json.dumps({"number": number, "method": "status", "body": "null"}), flush=True)
    return json.loads(sys.stdin.readline())
def stay():
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    while True:
        call()
        time.sleep(0.05)
"""
FIRST = "from pathlib import Path\nmark = Path({!r})\nif not mark.exists():\n    mark.touch()\n"
"""What follows, indented, is done in the first life only."""


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(keepers, "SILENCE_S", 0.7)
    monkeypatch.setattr(keepers, "PAUSES_S", (0.01, 0.05))


class Kept:
    """A node that is kept meanwhile."""

    def __init__(self, script: str) -> None:
        plan = NodePlan(name="node0", number=0, host="", secret="s" * 32, settings=Settings())
        self.link = Link()
        self.ended: list[str] = []
        command = [sys.executable, "-S", "-c", HEAD + script]
        self.keeper = NodeKeeper(plan, self.link, command)
        self.link.call, self._call = self._noted, self.link.call

    async def _noted(self, method, body):
        if method == "ended":
            self.ended.append(body.strip('"'))
        return await self._call(method, body)

    async def __aenter__(self):
        self.task = asyncio.create_task(self.keeper.keep())
        return self

    async def __aexit__(self, *_):
        self.keeper.stop()
        async with asyncio.timeout(20):
            await self.task
        assert self.keeper.pid is None


async def test_one_that_is_killed_is_started_again_under_another_name(quick):
    async with Kept("stay()") as kept:
        await until(lambda: kept.keeper._spoke)
        name, pid = kept.keeper.name, kept.keeper.pid
        os.kill(pid, signal.SIGKILL)
        await until(lambda: kept.keeper.restarts == 1 and kept.keeper._spoke)
        assert kept.keeper.pid not in (None, pid)
        assert kept.ended == [name] and kept.keeper.name != name
    assert kept.ended == [name], "while all end, nobody shall adopt anything"
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


async def test_one_that_falls_silent_is_killed_and_started_again(quick, tmp_path):
    silent = FIRST.format(str(tmp_path / "mark")) + "    call()\n    time.sleep(60)\n"
    async with Kept(silent + "stay()") as kept:
        await until(lambda: kept.keeper.restarts == 1 and kept.keeper._spoke)


async def test_one_that_ends_of_its_own_will_is_not_started_again(quick):
    async with Kept("call()\nsys.exit(0)") as kept, asyncio.timeout(20):
        await kept.task
    assert kept.keeper.restarts == 0 and kept.ended == [kept.keeper.name]


async def test_it_is_not_started_again_while_all_stop(monkeypatch):
    monkeypatch.setattr(keepers, "PAUSES_S", (60.0, 60.0))
    async with Kept("sys.exit(3)") as kept:
        await until(lambda: kept.keeper.restarts == 1)


async def test_what_is_no_call_is_passed_over_and_what_cannot_be_asked_is_told(quick):
    other = "call = lambda: (print('hello', flush=True), time.sleep(0.05))\nstay()"
    async with Kept(other) as kept:
        await until(lambda: kept.keeper._spoke)
    wrong = (
        'print(json.dumps({"number": 7, "method": "x", "body": ""}), flush=True)\n'
        "said = json.loads(sys.stdin.readline())\n"
        'sys.exit(0 if said["number"] == 7 and "no method" in said["body"] else 9)'
    )
    async with Kept(wrong) as kept, asyncio.timeout(20):
        await kept.task
    assert kept.keeper.restarts == 0
