"""`wayfarer serve` as a process, with the shipped models."""

import asyncio
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import psutil
import pytest

import wayfarer_client as wf
from tests.programs import run_program

COMMAND = [sys.executable, "-m", "wayfarer", "serve", "--log-format", "json"]
ANY_PORTS = ["--http-port", "0", "--grpc-port", "0"]
YARD = {
    "floors": [{"outline": [{"x": x, "y": 0, "z": z} for x, z in ((0, 0), (0, 9), (9, 9), (9, 0))]}]
}
"""Not an example scene: the server's own process bakes those."""
ENVIRONMENT = {k: v for k, v in os.environ.items() if not k.startswith("WAYFARER_")}
ENVIRONMENT["WAYFARER_ENGINE"] = "onnxruntime"  # a third of a start is the choice between engines


class Process:
    """A running service that has said it is ready."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.log: list[dict] = []
        for line in process.stderr:
            if not line.startswith("{"):
                process.terminate()
                raise AssertionError(f"no line of a log: {line}{process.stderr.read()}")
            self.log.append(json.loads(line))
            if self.log[-1]["event"] == "ready":
                break
        else:
            raise AssertionError(f"ended with {process.wait()}: {self.log}")
        self.http = self.log[-1]["http"]
        self.grpc = self.log[-1]["grpc"]

    def stop(self, sign: signal.Signals) -> int:
        self.process.send_signal(sign)
        self.log += [json.loads(line) for line in self.process.stderr]
        return self.process.wait(timeout=15)


@contextmanager
def serve(*arguments: str) -> Iterator[Process]:
    process = subprocess.Popen(
        [*COMMAND, *arguments], stderr=subprocess.PIPE, text=True, env=ENVIRONMENT
    )
    try:
        yield Process(process)
    finally:
        process.kill()
        process.wait()
        process.stderr.close()


def refused(*arguments: str) -> str:
    """The one-line message of a start that must fail."""
    answer = run_program(*COMMAND, *arguments, code=2, env=ENVIRONMENT)
    said = [line for line in answer.stderr.splitlines() if not line.startswith("{")]
    assert len(said) == 1, answer.stderr
    return said[0]


async def walk(address: str) -> list[wf.Frames]:
    """Two people walk for a while."""
    frames: list[wf.Frames] = []
    async with wf.Client(address) as client, await client.create_session() as session:
        people = await session.create_agents(
            wf.AgentSpec(gender="female", seed=1), wf.AgentSpec(gender="male", seed=2)
        )
        for person in people:
            await session.set_goal(person, (0, 0, 3))
        async with asyncio.timeout(60):
            async for batch in session.stream():
                frames += batch.frames
                if len(frames) >= 20:
                    return frames
    raise AssertionError("the stream ended")


def baking(service: Process) -> psutil.Process:
    """The one process that bakes this server's scenes, once there is one."""
    for count in (0, 1, 1):
        below = psutil.Process(service.process.pid).children(recursive=True)
        found = [one for one in below if "wayfarer.world.scenes.bake_process" in one.cmdline()]
        assert len(found) == count
        made = httpx.post(f"{service.http}/v1/scenes", json=YARD, timeout=60)
        assert made.is_success, made.text
    return found[0]


@pytest.mark.parametrize(
    ("sign", "options", "warnings"),
    [
        (signal.SIGTERM, ("--engine", "auto"), []),
        (signal.SIGINT, ("--host", "0.0.0.0", "--insecure-no-auth"), ["without authentication"]),
    ],
)
def test_starts_serves_and_stops(sign, options, warnings):
    with serve(*ANY_PORTS, *options) as service:
        bakery = baking(service)
        assert httpx.get(f"{service.http}/v1/health/ready").status_code == 200
        assert httpx.get(f"{service.http}/v1/models").json()["models"][0]["name"] == "gamma-anny52"
        frames = asyncio.run(walk(service.grpc))
        assert {f.agent.gender for f in frames} == {"female", "male"}
        assert all(0.5 < f.translation[:, 1].min() < 1.3 for f in frames)  # hips, Y up
        assert service.stop(sign) == 0
        assert service.log[-1]["event"] == "stopped"
        told = [line["event"] for line in service.log if line["level"] in ("warning", "error")]
        assert len(told) == len(warnings), told
        assert all(words in event for words, event in zip(warnings, told, strict=True))
        assert not psutil.wait_procs([bakery], timeout=15)[1]


def test_the_process_that_bakes_scenes_ends_with_a_server_that_is_killed():
    with serve(*ANY_PORTS) as service:
        bakery = baking(service)
        service.stop(signal.SIGKILL)
        assert not psutil.wait_procs([bakery], timeout=15)[1]
