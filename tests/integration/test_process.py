"""`wayfarer serve` as a process, with the shipped models."""

import asyncio
import signal

import httpx
import psutil
import pytest

import wayfarer_client as wf
from tests.programs import run_program
from tests.serving import COMMAND, ENVIRONMENT, Service

YARD = {
    "floors": [{"outline": [{"x": x, "y": 0, "z": z} for x, z in ((0, 0), (0, 9), (9, 9), (9, 0))]}]
}
"""Not an example scene: the server's own process bakes those."""


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


def baking(service: Service) -> psutil.Process:
    """The one process that bakes this server's scenes, once there is one."""
    for count in (0, 1, 1):
        below = psutil.Process(service.process.pid).children(recursive=True)
        found = [one for one in below if "wayfarer.world.scenes.bake_process" in one.cmdline()]
        assert len(found) == count
        made = httpx.post(f"{service.url}/v1/scenes", json=YARD, timeout=60)
        assert made.is_success, made.text
    return found[0]


@pytest.mark.parametrize(
    ("sign", "options", "warnings"),
    [
        (signal.SIGTERM, (), []),
        (
            signal.SIGINT,
            ("--engine", "onnxruntime", "--host", "0.0.0.0", "--insecure-no-auth"),
            ["without authentication"],
        ),
    ],
)
def test_starts_serves_and_stops(sign, options, warnings):
    with Service(*options, settings={}) as service:
        bakery = baking(service)
        assert httpx.get(f"{service.url}/v1/health/ready").status_code == 200
        assert httpx.get(f"{service.url}/v1/models").json()["models"][0]["name"] == "gamma-anny52"
        frames = asyncio.run(walk(service.grpc_address))
        assert {f.agent.gender for f in frames} == {"female", "male"}
        assert all(0.5 < f.translation[:, 1].min() < 1.3 for f in frames)  # hips, Y up
        assert service.stop(sign) == 0
        assert service.log[-1]["event"] == "stopped"
        told = [line["event"] for line in service.log if line["level"] in ("warning", "error")]
        assert len(told) == len(warnings), told
        assert all(words in event for words, event in zip(warnings, told, strict=True))
        assert not psutil.wait_procs([bakery], timeout=15)[1]


def test_the_process_that_bakes_scenes_ends_with_a_server_that_is_killed():
    with Service() as service:
        bakery = baking(service)
        service.stop(signal.SIGKILL)
        assert not psutil.wait_procs([bakery], timeout=15)[1]
