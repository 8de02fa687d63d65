"""The examples of the Python client's README, as written, against the real server."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import wayfarer_client as wf
from tests.programs import run_program
from wayfarer_client.admin import Admin
from wayfarer_client.scenes import Scenes

CLIENT = Path(__file__).parents[2] / "clients" / "python"
README = (CLIENT / "README.md").read_text()


def example(name: str, *arguments: str) -> str:
    return run_program(sys.executable, CLIENT / "examples" / name, *arguments).stdout


def test_first_stream(real_server):
    said = example("first_stream.py", real_server.grpc_address).splitlines()
    assert any(line.startswith("walking") for line in said)
    x, _, z = map(float, re.findall(r"-?\d+\.\d*", said[-1]))
    assert np.hypot(x - 2, z - 3) < 0.5


def test_control(real_server):
    said = example("control.py", real_server.grpc_address).splitlines()
    assert said == [f"corner {number} reached" for number in (1, 2, 3, 4)]


def test_resume(real_server):
    said = example("resume.py", real_server.grpc_address)
    numbers = [int(number) for number in re.findall(r"chunk (\d+)", said)]
    assert numbers == list(range(20)) and "without a gap: True" in said


def test_lock_step(real_server, tmp_path):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        example("lock_step.py", str(tmp_path / folder), real_server.grpc_address)
    for name in ("ada.npz", "bo.npz"):
        one, two = (np.load(tmp_path / folder / name) for folder in ("one", "two"))
        assert len(one["times"]) > 200 and one["rotations"].shape[1:] == (22, 4)
        np.testing.assert_array_equal(one["rotations"], two["rotations"])


def test_populate_square(real_server):
    said = example("populate_square.py", real_server.grpc_address, "3").splitlines()
    assert said[1:3] == ["3 people have come", "version 1 of the square"]
    assert any(line.startswith("path_done") for line in said)


@pytest.mark.parametrize("page", ["README.md", "clients/python/README.md"])
def test_the_first_stream_runs_until_ctrl_c_which_prints_nothing(real_server, page, tmp_path):
    text = (CLIENT.parents[1] / page).read_text("utf-8")
    (block,) = re.findall(r"```python\n(import asyncio\n.*?)```", text, re.DOTALL)
    script = tmp_path / "first.py"
    script.write_text(block.replace("localhost:50051", real_server.grpc_address))
    running = subprocess.Popen(
        [sys.executable, "-u", script],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # as in a terminal: a shell's background job, such as a CI runner's, ignores SIGINT
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert running.stdout.readline().startswith(("standing", "walking"))
    running.send_signal(signal.SIGINT)
    _, errors = running.communicate(timeout=30)
    assert (running.returncode, errors) == (0, "")


def test_the_readme_names_what_there_is():
    owners = {"client": wf.Client, "session": wf.Session}
    owners |= {"client.admin": Admin, "client.scenes": Scenes}
    owners |= {"Character": wf.Character, "track": wf.Track}
    table = README[README.index("| call |") : README.index("`SyncClient` and")]
    for row in filter(None, table.splitlines()[2:]):
        calls = re.findall(r"`([^`]+)`", row.split("|")[1])
        owner = None
        for call in calls:  # the first call of a row names their object
            prefix, _, name = call.partition("(")[0].rpartition(".")
            owner = owners[prefix] if prefix else owner
            assert hasattr(owner, name), call
    assert "skeleton" in table and "append_goals" in table


@pytest.mark.parametrize("block", re.findall(r"```python\n(.*?)```", README, re.DOTALL))
def test_the_readme_can_be_read_by_python(block):
    indent = re.match(r" *", block).group()
    compile("\n".join(line.removeprefix(indent) for line in block.splitlines()), "README", "exec")
