"""What docker-compose.cluster.yml runs, without containers: the same commands, in the same
environment, as processes of this machine.
"""

import asyncio
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
from importlib.util import find_spec
from pathlib import Path

import httpx
import psutil
import pytest

from tests.serving import LIGHT, free_port
from tests.test_deploy import DEPLOY, cluster_compose
from wayfarer_client import AgentSpec, Client

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed"),
]

HEAD = "entry:6379"
IMAGE = dict(re.findall(r"(RAY_\w+)=(\S+)", (DEPLOY / "kuberay/Dockerfile").read_text()))
"""Variables of its environment."""


class Services:
    """Those of the file, started one by one."""

    def __init__(self, folder):
        """`folder`: of Ray, by which its processes are known; a short path, for its sockets."""
        self._folder = folder
        self._port = str(free_port())
        self.said = []

    def environment(self, service):
        secret = "0123456789abcdef" * 4
        told = {name: re.sub(r"\$\{.*\}", secret, value) for name, value in
                service["environment"].items()}  # fmt: skip
        here = {"WAYFARER_HTTP_PORT": "0", "WAYFARER_GRPC_PORT": "0", "RAY_TMPDIR": self._folder}
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        return {**os.environ, **LIGHT, **IMAGE, **told, **here, "PATH": path}

    def start(self, name):
        service = cluster_compose()["services"][name]
        command = [
            word.replace(HEAD, f"127.0.0.1:{self._port}").replace("6379", self._port)
            for word in service["command"]
        ]
        process = subprocess.Popen(
            command, env=self.environment(service), text=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        threading.Thread(target=self._listen, args=[process], daemon=True).start()
        return process

    def entry(self, **more):
        """One more entry, to its end; `more`: variables of the environment."""
        found = cluster_compose()["services"]["entry"]
        address = f"127.0.0.1:{self._port}"
        return subprocess.run(
            [sys.executable, "-m", "wayfarer", "cluster", "entry", "--address", address],
            env=self.environment(found) | more, text=True, capture_output=True, timeout=90,
        )  # fmt: skip

    def _listen(self, process):
        self.said.extend(process.stdout)

    def probe(self, name):
        """Its health check, once."""
        service = cluster_compose()["services"][name]
        _, *words = service["healthcheck"]["test"]
        words = [word.replace(HEAD, f"127.0.0.1:{self._port}") for word in words]
        env = self.environment(service)
        return subprocess.run(words, env=env, capture_output=True, timeout=30).returncode

    async def until(self, found, what, seconds=90):
        async with asyncio.timeout(seconds):
            while not (answer := await asyncio.to_thread(found)):
                await asyncio.sleep(0.2)
            return answer

    def ready(self):
        """Its addresses, once the entry has said them."""
        for line in self.said:
            if line.startswith("{") and (told := json.loads(line))["event"] == "ready":
                return told
        return None

    def begun(self):
        """How many have started Ray, the head among them."""
        return sum("Ray runtime started" in line for line in self.said)

    def processes(self):
        """All that were started from here, daemons of Ray included."""
        for one in psutil.process_iter():
            try:
                if one.environ().get("RAY_TMPDIR") == self._folder:
                    yield one
            except psutil.Error:  # it has just ended, or is another user's
                pass


@pytest.fixture
def services():
    with tempfile.TemporaryDirectory(prefix="wf", dir="/tmp", ignore_cleanup_errors=True) as folder:
        made = Services(folder)
        yield made
        for one in made.processes():
            one.kill()


async def test_the_commands_of_compose_make_a_cluster(services):
    entry = services.start("entry")
    await services.until(services.begun, "Ray's head has started")  # each probe imports Ray
    await services.until(lambda: services.probe("entry") == 0, "Ray's head is well")
    replicas = 1  # of its three nodes, which are alike
    try:
        for number in range(replicas):  # one by one: on one machine they take each other's ports
            services.start("node")
            await services.until(lambda number=number: services.begun() > 1 + number, "Ray runs")
        told = await services.until(services.ready, "the entry is ready")

        def nodes():
            found = httpx.get(f"{told['http']}/v1/cluster").json()["nodes"]
            return len(found) == replicas and all(one["load"]["ready"] for one in found)

        await services.until(nodes, "all nodes are ready")
    except TimeoutError:
        pytest.fail("".join(services.said))
    async with Client(told["grpc"].replace("0.0.0.0", "127.0.0.1"), timeout=30) as client:
        session = await client.create_session()
        await session.create_agents(AgentSpec())
        async with session.stream() as stream:
            assert len((await anext(aiter(stream))).frames) == 1
    stranger = await asyncio.to_thread(services.entry, RAY_AUTH_TOKEN="of another cluster")
    assert stranger.returncode == 2 and "no Ray cluster at" in stranger.stderr
    entry.terminate()
    assert await asyncio.to_thread(entry.wait, 60) == 0, "".join(services.said)
    assert "the nodes continue" in services.said[-1]
