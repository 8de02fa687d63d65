"""`wayfarer serve --workers` with its Ray: the command, its processes, what may happen to each of
them, and their end.
"""

import asyncio
import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future
from types import SimpleNamespace

import httpx
import psutil
import pytest

from tests.certificates import Authority
from tests.cluster.local import listening, lives, processes
from tests.serving import LIGHT, needs_ray
from wayfarer import errors
from wayfarer_client import AgentSpec, Client, Floor, Misdirected, Unavailable

pytestmark = [pytest.mark.slow, needs_ray]

NODES = 2
LOCAL_ADDRESS = "127.0.0.2"  # of Ray, on one machine
ONE_THREAD = {"WAYFARER_ENGINE": "onnxruntime", "WAYFARER_THREADS": "1"}


class Command:
    """`wayfarer serve --workers`, once it is ready."""

    def __init__(self, *options, **more):
        """`more`: variables of the environment."""
        self.said = []
        free = ("--http-port", "0", "--grpc-port", "0", "--log-format", "json")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "wayfarer", "serve", *free, *options],
            env={**os.environ, **LIGHT, **ONE_THREAD, **more},
            stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            text=True,
        )
        self._killer = threading.Timer(400, self.process.kill)
        self._killer.start()
        for line in self.process.stderr:
            self.said.append(line)
            if line.startswith("{") and json.loads(line)["event"] == "ready":
                break
        else:
            pytest.fail("it did not start:\n" + "".join(self.said))
        self._listening = threading.Thread(target=self._listen, daemon=True)
        self._listening.start()
        self.ready = json.loads(self.said[-1])
        self.url, self.grpc = self.ready["http"], self.ready["grpc"]

    def _listen(self):
        self.said.extend(self.process.stderr)

    def processes(self, name=""):
        """Processes of Ray or of nodes; see `processes`."""
        return processes(name, self.process.pid)

    def kill(self, name):
        """The first of these."""
        self.processes(name)[0].send_signal(signal.SIGKILL)

    def nodes(self):
        """Names and ports of the nodes that take sessions."""
        told = httpx.get(self.url + "/v1/cluster").raise_for_status().json()
        return {n["node"]["name"]: n["node"]["grpc_port"] for n in told["nodes"]
                if n["load"]["ready"]}  # fmt: skip

    def health(self):
        """Status and document."""
        answer = httpx.get(self.url + "/v1/health/ready")
        return answer.status_code, answer.json()

    def processor_s(self):
        """Processor time of the command itself."""
        return sum(psutil.Process(self.process.pid).cpu_times()[:2])

    async def until(self, good, what, seconds=90):
        ends_at = time.monotonic() + seconds
        while not await asyncio.to_thread(good):
            if time.monotonic() > ends_at:
                pytest.fail(f"{what}: not within {seconds} s\n" + "".join(self.said[-40:]))
            await asyncio.sleep(0.2)

    def ctrl_c(self, seconds=0.5):
        """Send it twice: the command ends well, and all that it has started within `seconds`."""
        theirs = self.processes()
        self.process.send_signal(signal.SIGINT)
        time.sleep(1)
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(60) == 0
        assert not [one for one in psutil.wait_procs(theirs, seconds)[1] if lives(one)]
        self._listening.join(10)
        told = "".join(self.said)
        assert "Traceback" not in told, told
        assert "did not end" not in told, told

    def close(self):
        self._killer.cancel()
        left = self.processes()
        self.process.kill()
        self.process.wait()
        for one in left:  # which had no chance to end
            if one.is_running():
                one.kill()


@pytest.fixture
def start():
    """Starts one; it ends with the test."""
    started = []

    def begin(*options, **more):
        started.append(Command(*options, **more))
        return started[-1]

    yield begin
    for one in started:
        one.close()


class Follower:
    """One person's stream, over whatever happens."""

    @classmethod
    async def of(cls, client, scene=""):
        self = cls()
        self.session = await client.create_session(lease=900, scene=scene)
        (self.person,) = await self.session.create_agents(AgentSpec())
        self.flags, self.events = [], []
        self.task = asyncio.create_task(self._follow())
        return self

    def port(self, client):
        """The port of the node that has the session."""
        return int(client.connection.homes.home(self.session.session_id).rpartition(":")[2])

    async def _follow(self):
        async with self.session.stream(deadline=60) as stream:
            async for batch in stream:
                self.events += [event.kind for event in batch.events]
                self.flags += [frames.flags for frames in batch.frames]

    async def goes_on(self, chunks=5):
        """What came meanwhile: flags and events."""
        self.flags.clear()
        self.events.clear()
        async with asyncio.timeout(60):
            while len(self.flags) < chunks:
                assert not self.task.done(), self.task
                await asyncio.sleep(0.05)
        return list(self.flags), list(self.events)


async def test_nodes_live_on_whatever_happens_to_ray(start, tmp_path):
    """All stages run with certificates."""
    authority = Authority(tmp_path)
    cert, key = authority.issue("node", addresses=("127.0.0.1", LOCAL_ADDRESS))
    given = {"CERT": str(cert), "KEY": str(key), "CA": str(authority.path)}
    command = start(
        *("--workers", str(NODES)),
        **{f"WAYFARER_PEER_TLS__{name}": path for name, path in given.items()},
    )
    await command.until(lambda: len(command.nodes()) == NODES, "all nodes are ready")
    async with Client(command.grpc, timeout=30) as client:
        everybody = [await Follower.of(client) for _ in range(2 * NODES)]
        ports = [one.port(client) for one in everybody]
        assert command.grpc not in ports
        assert len(set(ports)) == NODES, "they are spread"
        await asyncio.gather(*(one.goes_on() for one in everybody))

        # a node, whose neighbour has its people then, a crowd in its scene among them
        corners = [(-5, 0, -5), (5, 0, -5), (5, 0, 45), (-5, 0, 45)]
        field = await client.scenes.create([Floor(corners)])
        there = await Follower.of(client, field.scene_id)
        await there.session.populate(3, seed=1, stay=2.0)
        await there.goes_on(10)
        await asyncio.sleep(1.5)  # all is copied to the neighbour, the scene first
        port = there.port(client)
        victim = next(p for p in command.processes("NodeActor") if port in listening(p))
        others = [one for one in everybody if one.port(client) == port]
        victim.kill()
        crowd = set()
        async with asyncio.timeout(60):
            while not crowd:
                with contextlib.suppress(Unavailable, Misdirected):  # as calls do meanwhile
                    crowd = {agent.agent_id for agent in await there.session.agents()}
                await asyncio.sleep(0.1)
        await asyncio.gather(*(one.goes_on() for one in (there, *others)))
        assert there.port(client) != port and there.person.agent_id in crowd
        async with asyncio.timeout(60):
            while {agent.agent_id for agent in await there.session.agents()} <= crowd:
                await asyncio.sleep(0.1)  # others still come
        there.task.cancel()
        await there.session.delete()

        # Ray starts it again
        await command.until(lambda: len(command.nodes()) == NODES, "it is back")

        # the directory, which Ray starts again: nodes tell it what they hold
        ports = [one.port(client) for one in everybody]
        command.kill("DirectoryActor")
        await command.until(lambda: command.health()[0] == 200, "the directory is back")
        await asyncio.gather(*(one.goes_on() for one in everybody))
        assert [one.port(client) for one in everybody] == ports, "nobody had to be adopted"
        newcomer = await client.create_session()
        await newcomer.create_agents(AgentSpec())

        # Ray's head, and the directory with it: nothing new, and it is said; all stand still
        command.kill("gcs_server")
        command.kill("DirectoryActor")
        # not ready at once if nobody had room; away once it has kept silent
        await command.until(lambda: command.health()[1]["away"], "the directory is away")
        assert command.health()[0] == 503
        figures = (await asyncio.to_thread(httpx.get, command.url + "/metrics")).text
        assert "wayfarer_cluster_directory_up 0.0" in figures
        await command.until(lambda: command.health()[1]["head"] is False, "its end is told")
        async with Client(command.grpc, timeout=2) as other:
            with pytest.raises(Unavailable, match="directory"):
                await other.create_session()
            # its node waits once its lease has ended; or the entry has not heard of it yet
            with pytest.raises(Unavailable, match=r"lost touch|not found yet"):
                async with asyncio.timeout(60):
                    while True:
                        await other.session(newcomer.session_id)
                        await asyncio.sleep(0.2)
        await asyncio.sleep(1)  # the leases of all nodes have ended
        spent = command.processor_s()
        began = time.monotonic()
        for one in everybody:
            one.flags.clear()
        await asyncio.sleep(2)
        assert not any(one.flags for one in everybody), "a node steps without a lease"
        assert command.processor_s() - spent < 0.3 * (time.monotonic() - began), "it spins"
        for one in everybody:
            one.task.cancel()
    assert len(command.processes("NodeActor")) == NODES
    command.ctrl_c(60)  # two helpers of Ray look for their head for half a minute


def handle(result=None):
    """A handle of an actor that gives this answer to all calls; None: it never answers."""
    answered = Future()
    if isinstance(result, Exception):
        answered.set_exception(result)
    elif result is not None:
        answered.set_result(result)
    asked = SimpleNamespace(remote=lambda *told: SimpleNamespace(future=lambda: answered))
    return SimpleNamespace(look=asked, until_ready=asked)


async def test_a_directory_that_does_not_answer_is_looked_for_again(monkeypatch):
    """Its first handle is kept: Ray ends an actor of one program when that is let go."""
    from wayfarer.cluster import actors

    lost = handle(actors.ray.exceptions.RayError())
    link = actors.RayLink(lost)
    monkeypatch.setattr(actors.ray, "get_actor", lambda name, space: handle(f"{name} is here"))
    with pytest.raises(errors.Unavailable, match="RayError"):
        await link.call("look")
    link._actor._finding.join()
    assert await link.call("look") == "directory is here"
    assert link._actor._first is lost


async def test_a_node_that_cannot_start_is_told_at_once():
    """Not once those before it are ready."""
    from wayfarer.cluster import ray_cluster

    failed = ray_cluster.ray.exceptions.RayError()
    failed.cause = errors.Unavailable("the port is taken")
    made = object.__new__(ray_cluster.RayCluster)
    made._nodes = {"node0": handle(), "node1": handle(failed)}
    with pytest.raises(errors.Unavailable, match=r"node 1 ended while .* the port is taken"):
        await asyncio.wait_for(made.until_ready(), 5)


def test_ray_calls_nobody():
    code = "import wayfarer.cluster.ray_settings, os; print(os.environ['RAY_USAGE_STATS_ENABLED'])"
    told = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=told)
    assert done.stdout.split()[-1] == "0", done.stderr
