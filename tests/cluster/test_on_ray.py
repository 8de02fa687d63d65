"""`wayfarer cluster start` with real Ray: the command, its processes, what may happen to each of
them, and their end.
"""

import asyncio
import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from importlib.util import find_spec

import httpx
import psutil
import pytest

from tests.certificates import Authority
from tests.serving import LIGHT
from wayfarer_client import AgentSpec, Client

if find_spec("ray") is None:
    # `make test` installs it for all Pythons for which there is one: there it is never left out
    assert not (os.environ.get("CI") and sys.version_info < (3, 15)), "Ray is not installed"
    pytest.skip("Ray is not installed: `pip install .[cluster]`", allow_module_level=True)
pytestmark = pytest.mark.slow

LOCAL_ADDRESS = "127.0.0.2"  # of Ray, on one machine
ONE_THREAD = {"WAYFARER_ENGINE": "onnxruntime", "WAYFARER_THREADS": "1"}


class Command:
    """`wayfarer cluster start`, once it is ready."""

    def __init__(self, *options, **more):
        """`more`: variables of the environment."""
        self.said = []
        free = ("--http-port", "0", "--grpc-port", "0", "--log-format", "json")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "wayfarer.cli", "cluster", "start", *free, *options],
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
        threading.Thread(target=self._listen, daemon=True).start()
        self.ready = json.loads(self.said[-1])
        self.url, self.grpc = self.ready["http"], self.ready["grpc"]

    def _listen(self):
        self.said.extend(self.process.stderr)

    def processes(self, name=""):
        """Of Ray or of nodes, by a part of the command; Ray's actors by their class."""
        found = []
        with contextlib.suppress(psutil.NoSuchProcess):  # the command itself has ended
            for one in psutil.Process(self.process.pid).children(recursive=True):
                with contextlib.suppress(psutil.Error):  # it has just ended
                    if name in " ".join(one.cmdline()):
                        found.append(one)
        return found

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

    async def until(self, good, what, seconds=90):
        ends_at = time.monotonic() + seconds
        while not await asyncio.to_thread(good):
            if time.monotonic() > ends_at:
                pytest.fail(f"{what}: not within {seconds} s\n" + "".join(self.said[-40:]))
            await asyncio.sleep(0.2)

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


async def test_a_cluster_of_two_with_certificates_ends_with_its_command(start, tmp_path):
    authority = Authority(tmp_path)
    cert, key = authority.issue("node", addresses=("127.0.0.1", LOCAL_ADDRESS))
    given = {"CERT": str(cert), "KEY": str(key), "CA": str(authority.path)}
    command = start(
        "--nodes", "2", **{f"WAYFARER_PEER_TLS__{name}": path for name, path in given.items()}
    )
    async with Client(command.grpc, timeout=30) as client:
        session = await client.create_session()
        await session.create_agents(AgentSpec())
        async with session.stream() as stream:
            assert len((await anext(aiter(stream))).frames) == 1
        node = client.connection.homes.home(session.session_id)
        assert node != command.grpc, "it is called on its own node"
    command.process.send_signal(signal.SIGINT)
    assert command.process.wait(60) == 0
    port = int(node.rpartition(":")[2])
    with pytest.raises(ConnectionRefusedError):  # its nodes have ended with it
        socket.create_connection(("127.0.0.1", port)).close()


def test_ray_calls_nobody():
    code = "import wayfarer.cluster.ray_actors, os; print(os.environ['RAY_USAGE_STATS_ENABLED'])"
    told = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=told)
    assert done.stdout.split()[-1] == "0", done.stderr
