"""A node's actor, without Ray: its server is a function of this module."""

import os
import signal
import subprocess
import sys
import textwrap

import pytest

from tests.cluster.nodes import info

pytest.importorskip("ray")

START = """
import asyncio, sys, time
from wayfarer.cluster import actors
from wayfarer.cluster.messages import NodePlan
from wayfarer.config.settings import Settings
from wayfarer.errors import Unavailable

actors.PAUSE_S, actors.HANGS_S, actors.BEAT_S = 0.0, 0.5, 0.1

class Kill:
    @staticmethod
    def get_runtime_context(): return Kill
    current_actor = None
    @staticmethod
    def kill(actor, no_restart): print("gone", flush=True)
    @staticmethod
    def get_actor(*_): raise ValueError
    exceptions = actors.ray.exceptions

actors.ray = Kill

async def work(node):
    stop = asyncio.Event()
    node.listen(stop.set, lambda: print("read again", flush=True))
    {work}

def serve(node):
    asyncio.run(work(node))

sys.modules["played"] = sys.modules["__main__"]
plan = NodePlan(name="node0", number=0, host="", settings=Settings())
node = actors.NodeActor(plan, "played:serve")
{then}
"""


def played(work, then):
    """Output and end of a process whose node does this `work`, and is then asked for `then`."""
    code = START.format(work=textwrap.indent(work, "    ").strip(), then=then)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout + done.stderr


def test_it_drains_by_a_call_or_a_signal_and_is_not_started_again():
    work = "node.ready()\nawait stop.wait()\nprint('drained', flush=True)"
    for asks in ("node.stop()", "import os, signal; os.kill(os.getpid(), signal.SIGTERM)"):
        then = f"node.until_ready(); node.reload(); {asks}; node._ended.wait(); time.sleep(0.3)"
        code, said = played(work, then)
        assert code == 0 and said.split("\n")[:3] == ["read again", "drained", "gone"], said


def test_a_start_that_fails_ends_the_process_as_failed():
    code, said = played("raise Unavailable('the port is taken')", "time.sleep(30)")
    assert code == 1 and "the port is taken" in said


def test_a_node_that_hangs_ends_and_says_where():
    code, said = played("node.ready()\ntime.sleep(30)", "time.sleep(30)")
    assert code == 1 and "Timeout" in said and "in work" in said


def test_the_end_of_a_process_of_this_machine_is_seen():
    from wayfarer.cluster.actors import watch
    from wayfarer.cluster.node_lease import machine

    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        node = info("n1").model_copy(update={"machine": machine(), "pid": process.pid})
        has_ended = watch(node)
        elsewhere = watch(node.model_copy(update={"machine": "another"}))
        assert machine() and not has_ended(False)
        process.kill()
    assert has_ended(False) and not elsewhere(False)
    assert watch(node)(False), "it had ended before"


def test_a_stopped_process_of_this_machine_ends_once_it_is_forsaken():
    from wayfarer.cluster.actors import watch
    from wayfarer.cluster.node_lease import machine

    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        has_ended = watch(info("n1").model_copy(update={"machine": machine(), "pid": process.pid}))
        assert not has_ended(True), "it is not stopped: it may only be busy"
        process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, process.pid, os.WSTOPPED)
        assert not has_ended(False), "it may continue"
        has_ended(True)
        assert process.wait(10) == -signal.SIGKILL
        assert has_ended(True)
