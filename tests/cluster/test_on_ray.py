"""`wayfarer cluster start` with real Ray: the command, its processes, and their end."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading

import pytest

from tests.serving import LIGHT
from wayfarer_client import AgentSpec, Client

pytest.importorskip("ray")
pytestmark = pytest.mark.slow


@pytest.fixture
def cluster(tmp_path):
    """What the command said when it was ready, and its process."""
    options = ("--nodes", "2", "--http-port", "0", "--grpc-port", "0", "--log-format", "json")
    process = subprocess.Popen(
        [sys.executable, "-m", "wayfarer.cli", "cluster", "start", *options],
        env={**os.environ, **LIGHT, "WAYFARER_ENGINE": "onnxruntime"},
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    said = []
    killer = threading.Timer(400, process.kill)
    killer.start()
    for line in process.stderr:
        said.append(line)
        if line.startswith("{") and json.loads(line)["event"] == "ready":
            break
    else:
        pytest.fail("it did not start:\n" + "".join(said))
    threading.Thread(target=process.stderr.read, daemon=True).start()
    yield json.loads(said[-1]), process
    process.kill()
    process.wait()
    killer.cancel()


async def test_a_cluster_of_two_on_ray(cluster):
    ready, process = cluster
    async with Client(ready["grpc"], timeout=30) as client:
        session = await client.create_session()
        await session.create_agents(AgentSpec())
        async with session.stream() as stream:
            assert len((await anext(aiter(stream))).frames) == 1
        node = client.connection.homes.home(session.session_id)
        assert node != ready["grpc"], "it is called on its own node"
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 0
    port = int(node.rpartition(":")[2])
    with pytest.raises(ConnectionRefusedError):  # its nodes have ended with it
        socket.create_connection(("127.0.0.1", port)).close()


def test_ray_calls_nobody():
    code = "import wayfarer.cluster.ray_actors, os; print(os.environ['RAY_USAGE_STATS_ENABLED'])"
    told = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=told)
    assert done.stdout.split()[-1] == "0", done.stderr
