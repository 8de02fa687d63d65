"""The client that is generated for another language, against the real server."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "clients" / "node"

pytestmark = pytest.mark.skipif(
    not (shutil.which("node") and (FOLDER / "src" / "gen").is_dir()),
    reason="clients/node is not set up: cd clients/node && npm ci && npm run generate",
)


def node(*arguments: str, **environment: str) -> str:
    done = subprocess.run(
        ["node", *arguments],
        cwd=FOLDER,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=180,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_session_agents_goals_stream_goal_change_resume(cluster):
    """Through the entry of a cluster, whose node is drained on the way."""
    with cluster.drained_meanwhile():
        said = node("--test", "test/server.test.js", WAYFARER_ADDRESS=cluster.grpc_address)
    assert "pass 2" in said and "skipped 0" in said


def test_a_control_stream_goes_on_when_its_node_is_drained(cluster):
    with cluster.drained_meanwhile():
        said = node("--test", "test/move.test.js", WAYFARER_CLUSTER=cluster.grpc_address)
    assert "pass 1" in said and "skipped 0" in said


def test_a_control_stream_goes_on_when_its_node_is_killed(cluster):
    with cluster.killed_meanwhile():
        said = node(
            *("--test", "test/move.test.js"),
            WAYFARER_CLUSTER=cluster.grpc_address,
            WAYFARER_KILLED="1",
        )
    assert "pass 1" in said and "skipped 0" in said


def test_the_example_walks_to_its_goal(real_server):
    *_, last = node("examples/first-stream.js", real_server.grpc_address).splitlines()
    x, z = map(float, last.partition(": (")[2].rstrip(")").split(", "))
    assert abs(x - 2) < 0.5 and abs(z - 3) < 0.5


def test_the_example_finds_its_way_in_a_scene(real_server):
    said = node("examples/scene.js", real_server.grpc_address).splitlines()
    assert "version 1" in said and any(line.startswith("PATH_DONE") for line in said)
