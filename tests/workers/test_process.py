"""A worker's process, played by a few lines of Python that speak as one."""

import asyncio
import os
import signal
import sys
from pathlib import Path

import pytest

from tests.transport.rig import until
from wayfarer.errors import Unavailable
from wayfarer.workers.process import Patience, WorkerProcess
from wayfarer.workers.supervisor import Supervisor

READY = '{"alive": true, "ready": true, "started": true, "agents": 3, "sessions": 1}'
HEAD = (
    "import json, os, signal, sys, time\nassert json.loads(sys.stdin.readline()) == {'index': 0}\n"
)
REPORT = f"print({READY!r}, flush=True)\n"
STAY = f"""
signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
while True:
    {REPORT}    time.sleep(0.05)
"""
QUICK = Patience(start=20.0, silence=0.7, first_pause=0.01, longest_pause=0.05)


def worker(script: str, patience: Patience = QUICK) -> WorkerProcess:
    command = [sys.executable, "-S", "-c", HEAD + script]
    return WorkerProcess(0, command, b'{"index": 0}', patience)


async def test_is_ready_when_all_are_and_stops_when_told():
    supervisor = Supervisor([worker(STAY), worker(STAY)])
    assert not supervisor.ready and not supervisor.started
    await supervisor.start()
    assert supervisor.ready and supervisor.started
    assert [w.report.agents for w in supervisor.workers] == [3, 3]
    pids = [w.pid for w in supervisor.workers]
    await supervisor.stop(10)
    assert [w.pid for w in supervisor.workers] == [None, None]
    assert not supervisor.ready
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


async def test_one_that_is_killed_is_started_again_and_the_others_are_left_alone():
    supervisor = Supervisor([worker(STAY), worker(STAY)])
    await supervisor.start()
    first, second = supervisor.workers
    killed, kept = first.pid, second.pid
    first.signal(signal.SIGKILL)
    await until(lambda: first.restarts == 1 and supervisor.ready)
    assert first.pid not in (None, killed) and second.pid == kept and second.restarts == 0
    await supervisor.stop(10)


FIRST = "from pathlib import Path\nmark = Path({!r})\nif not mark.exists():\n    mark.touch()\n"
"""What follows, indented, is done in the first life only."""


@pytest.mark.parametrize("then", ["time.sleep(60)", "while True: {}; time.sleep(0.05)"])
async def test_one_that_falls_silent_or_hangs_is_killed_and_started_again(tmp_path: Path, then):
    stuck = REPORT.strip().replace('"alive": true', '"alive": false')
    first = FIRST.format(str(tmp_path / "mark")) + f"    {REPORT}    {then.format(stuck)}\n"
    supervisor = Supervisor([worker(first + STAY)])
    await supervisor.start()
    await until(lambda: supervisor.workers[0].restarts == 1 and supervisor.ready)
    await supervisor.stop(10)


async def test_one_that_cannot_start_fails_the_whole_server():
    supervisor = Supervisor([worker(STAY), worker("sys.exit(2)")])
    with pytest.raises(Unavailable, match="worker 0 ended with 2 while starting"):
        await supervisor.start()
    await supervisor.stop(10)
    assert all(w.pid is None for w in supervisor.workers)


async def test_one_that_ends_of_its_own_will_ends_the_server():
    supervisor = Supervisor([worker(STAY), worker(REPORT + "time.sleep(0.3)\nsys.exit(0)")])
    await supervisor.start()
    async with asyncio.timeout(20):
        await supervisor.until_one_ends()
    assert supervisor.workers[1].restarts == 0
    await supervisor.stop(10)


async def test_one_that_does_not_drain_in_time_is_killed():
    stubborn = STAY.replace("lambda *_: sys.exit(0)", "signal.SIG_IGN")
    supervisor = Supervisor([worker(stubborn)])
    await supervisor.start()
    async with asyncio.timeout(10):
        await supervisor.stop(0.2)
    assert supervisor.workers[0].pid is None


async def test_it_is_not_started_again_while_the_server_stops():
    one = worker("sys.exit(3)", Patience(first_pause=60.0))
    one._was_ready = True
    task = asyncio.create_task(one.keep())
    await until(lambda: one.restarts == 1)
    one.stop()
    async with asyncio.timeout(5):
        await task


async def test_what_is_no_report_is_passed_over():
    supervisor = Supervisor([worker("print('hello', flush=True)\n" + STAY)])
    await supervisor.start()
    assert supervisor.ready
    await supervisor.stop(10)
