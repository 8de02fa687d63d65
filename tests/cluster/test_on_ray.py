"""`wayfarer serve --workers` with its Ray and its state: the command, its processes, what may
happen to each of them, and their end.
"""

import asyncio
import contextlib
import os
import re
import signal
import sys
import time
from concurrent.futures import Future
from types import SimpleNamespace

import httpx
import psutil
import pytest

from tests.certificates import Authority
from tests.cluster.local import listening, lives, processes
from tests.cluster.watchers import Watcher, go_on
from tests.programs import run_program
from tests.serving import LIGHT, Service, needs_ray
from wayfarer import errors
from wayfarer.cluster.messages import SILENT_S
from wayfarer_client import AgentSpec, Client, Unavailable

pytestmark = [pytest.mark.slow, needs_ray]

NODES = 2
LOCAL_ADDRESS = "127.0.0.2"  # of Ray, on one machine
AGENTS = re.compile("ray::(RuntimeEnv|Dashboard)Agent")


class Command(Service):
    """`wayfarer serve --workers`, once it is ready."""

    def __init__(self, *options, **more):
        """`more`: variables of the environment."""
        super().__init__(*options, settings={**LIGHT, "WAYFARER_THREADS": "1", **more})

    def processes(self, name=""):
        """Processes of Ray or of nodes; see `processes`."""
        return processes(name, self.process.pid)

    def kill(self, name):
        """The first of these."""
        self.processes(name)[0].kill()

    def node(self, number):
        """Its process."""
        told = self.cluster()[number]["node"]
        return next(p for p in self.processes("NodeActor") if told["grpc_port"] in listening(p))

    def cluster(self):
        """Nodes by their number."""
        told = httpx.get(self.url + "/v1/cluster").raise_for_status().json()
        return {one["node"]["number"]: one for one in told["nodes"]}

    def home(self, session):
        """Number of the node that has it."""
        answer = httpx.get(f"{self.url}/v1/sessions/{session.session_id}")
        assert answer.status_code == 421, answer.text
        return answer.json()["endpoint"]["worker"]

    def nodes(self):
        """How many take sessions now: none is placed on a silent one, as on a busy machine."""
        told = self.cluster().values()
        return sum(one["load"]["ready"] and one["silent_s"] < SILENT_S / 2 for one in told)

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

    def ctrl_c(self):
        """Send it twice: the command ends well, and all that it has started, but for two helpers of
        Ray, which look for their head for half a minute.
        """
        theirs = [one for one in self.processes() if not AGENTS.search(" ".join(one.cmdline()))]
        self.process.send_signal(signal.SIGINT)
        time.sleep(1)
        self.process.send_signal(signal.SIGINT)
        assert self.ended(60) == 0
        assert not [one for one in psutil.wait_procs(theirs, 1)[1] if lives(one)]
        told = "".join(self.said)
        assert "Traceback" not in told, told
        assert "did not end" not in told, told

    def close(self):
        left = self.processes()
        self.process.kill()
        for one in left:  # which had no chance to end
            if one.is_running():
                one.kill()
        self.ended()


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


async def followed(client, command, scene=""):
    """A new person's stream. All nodes take sessions by then, so that several are spread."""
    await command.until(lambda: command.nodes() == NODES, "all nodes take sessions")
    session = await client.create_session(lease=900, scene=scene)
    (agent,) = await session.create_agents(AgentSpec())
    return Watcher(session, agent, deadline=120)


async def all_go_on(everybody):
    """Forgets what has come so far, and waits for more of each."""
    for one in everybody:
        one.clear()
    await go_on(everybody)


async def people(session):
    """Ids of its agents, once its node is back."""
    async with asyncio.timeout(120):
        while True:
            with contextlib.suppress(Unavailable):
                return {agent.agent_id for agent in await session.agents()}
            await asyncio.sleep(0.1)


async def test_sessions_live_on_whatever_happens_to_nodes_and_ray(start, tmp_path):
    """All stages run with certificates."""
    authority = Authority(tmp_path)
    cert, key = authority.issue("node", addresses=("127.0.0.1", LOCAL_ADDRESS))
    given = {"CERT": str(cert), "KEY": str(key), "CA": str(authority.path)}
    told = {f"WAYFARER_PEER_TLS__{name}": path for name, path in given.items()}
    options = "--workers", str(NODES), "--state-dir", str(tmp_path / "state")
    command = start(*options, **told)
    async with Client(command.grpc_address, timeout=60) as client:
        scene = await client.scenes.example("corridor")
        everybody = [await followed(client, command, where) for where in (scene, "", "", "")]
        homes = {one.session.session_id: command.home(one.session) for one in everybody}
        assert set(homes.values()) == set(range(NODES)), "they are spread"
        assert {one.session_id for one in await client.sessions()} == set(homes)
        assert len(await client.scenes.all()) == 1
        await all_go_on(everybody)

        # a node, which Ray starts again: acknowledged commands are on disk, and wait for it
        killed = homes[everybody[0].session.session_id]
        there = [one for one in everybody if homes[one.session.session_id] == killed]
        late = {one: (await one.session.create_agents(AgentSpec()))[0] for one in there}
        await all_go_on(everybody)
        command.node(killed).kill()
        for one in there:
            assert late[one].agent_id in await people(one.session)
            async with asyncio.timeout(60):
                while "gap" not in one.events:  # chunks sent before may arrive after it
                    assert not one.task.done(), one.task
                    await asyncio.sleep(0.05)
        await all_go_on(everybody)
        for one in everybody:
            assert one in there or one.stream.reconnections == 0, "they do not notice"
            await one.close()
    below = command.processes("NodeActor")
    assert len(below) == NODES
    command.process.kill()
    assert not psutil.wait_procs(below, timeout=120)[1], "nodes outlive their parent"

    command = start(*options, **told)
    async with Client(command.grpc_address, timeout=60) as client:
        back = {one.session_id: one for one in await client.sessions()}
        assert {name: command.home(one) for name, one in back.items()} == homes
        assert len(await client.scenes.all()) == 1
        everybody = [Watcher(one, (await one.agents())[0], deadline=120) for one in back.values()]
        await all_go_on(everybody)
        await the_head_dies(command, everybody)
        for one in everybody:
            await one.close()
    assert len(command.processes("NodeActor")) == NODES
    command.ctrl_c()


async def the_head_dies(command, everybody):
    """The directory ends, too: nothing new is made, entries say so, and all stand still."""
    command.kill("gcs_server")
    command.kill("DirectoryActor")
    # not ready at once if nobody had room; away once it has kept silent
    await command.until(lambda: command.health()[1]["away"], "the directory is away")
    assert command.health()[0] == 503
    figures = (await asyncio.to_thread(httpx.get, command.url + "/metrics")).text
    assert "wayfarer_cluster_directory_up 0.0" in figures
    await command.until(lambda: command.health()[1]["head"] is False, "its end is reported")
    async with Client(command.grpc_address, timeout=10) as other:
        with pytest.raises(Unavailable, match="directory"):
            await other.create_session()
        for one in everybody:  # its node waits once its lease has ended
            with pytest.raises(Unavailable, match="lost touch"):
                async with asyncio.timeout(60):
                    while True:
                        await other.session(one.session.session_id)
                        await asyncio.sleep(0.2)
    await asyncio.sleep(1)  # what was sent before has come
    spent, began = command.processor_s(), time.monotonic()
    for one in everybody:
        one.flags.clear()
    await asyncio.sleep(2)
    assert not any(one.flags for one in everybody), "a node steps without a lease"
    assert command.processor_s() - spent < 0.3 * (time.monotonic() - began), "it spins"


def handle(result=None):
    """A handle of an actor that gives this answer to all calls; None: it never answers."""
    answered = Future()
    if isinstance(result, Exception):
        answered.set_exception(result)
    elif result is not None:
        answered.set_result(result)
    asked = SimpleNamespace(remote=lambda *told: SimpleNamespace(future=lambda: answered))
    return SimpleNamespace(look=asked, until_ready=asked)


@pytest.mark.parametrize("of_another_release", [False, True])
async def test_a_directory_that_does_not_answer_is_looked_for_again(
    monkeypatch, of_another_release
):
    """Its first handle is kept: Ray ends an actor of one program when that is let go. To another
    release's, Ray makes a handle whose methods take no arguments.
    """
    from wayfarer.cluster import actors

    error = TypeError if of_another_release else actors.ray.exceptions.RayError
    lost = handle(error())
    link = actors.RayLink(lost)
    monkeypatch.setattr(actors.ray, "get_actor", lambda name, space: handle(f"{name} is here"))
    with pytest.raises(errors.Unavailable, match=error.__name__):
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


def test_a_start_of_ray_that_fails_leaves_no_process(monkeypatch):
    """As on a machine that is too busy for it: its head runs by then."""
    from wayfarer.cluster import ray_cluster

    others, begun = processes(), []

    def fail(self):
        begun.append(len(processes()) - len(others))
        raise RuntimeError("timed out")

    monkeypatch.setattr(ray_cluster.ray._private.node.Node, "start_ray_processes", fail)
    with pytest.raises(errors.Unavailable, match="no Ray cluster at this machine: timed out"):
        ray_cluster.RayCluster()
    assert len(begun) == ray_cluster.TRIES and min(begun) > 0
    assert not [one for one in processes() if one not in others and lives(one)]


def test_ray_calls_nobody():
    code = "import wayfarer.cluster.ray_settings, os; print(os.environ['RAY_USAGE_STATS_ENABLED'])"
    told = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    assert run_program(sys.executable, "-c", code, env=told).stdout.split()[-1] == "0"
