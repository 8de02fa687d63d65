"""An agent whose way cannot be found, in the real server: other sessions miss nothing.

Without the models: an engine that walks. The real ways, streams, probes and metrics.
"""

import asyncio
import re
import sys
from dataclasses import replace

import httpx
import pytest

import wayfarer_client as wf
from tests.service.kept_worlds import fake_worlds
from tests.service.running import until
from wayfarer.config import Settings
from wayfarer.errors import Unavailable
from wayfarer.limits import Limits
from wayfarer.navigation.scene import Scene
from wayfarer.serve import SIGNALS, serve
from wayfarer.service.faults import FaultLog
from wayfarer.service.live import steady_clock
from wayfarer.service.motion_service import MotionService
from wayfarer.service.thread import MotionThread
from wayfarer.transport.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.server import Server
from wayfarer.transport.server_options import ServerOptions

FIELD = {
    "floors": [
        {"outline": [{"x": x, "y": 0, "z": z} for x, z in ((0, 0), (0, 12), (12, 12), (12, 0))]}
    ]
}
SECONDS = 6.0


@pytest.fixture
async def running():
    """A server where every error is attributed to an agent or session."""
    clock, operation = steady_clock(), ServerOptions()
    limits = Limits(agents=32, agents_per_session=32, sessions=4, queue_s=30.0)
    worlds = replace(fake_worlds(limits=limits), report=FaultLog(operation.metrics))
    runtime = MotionService(worlds, clock=clock, meter=operation.metrics)
    gateway = Gateway(runtime, BodyLibrary("anny52"), Limits(), clock, stop=lambda: None)
    server = Server(gateway, "127.0.0.1", 0, 0, operation)
    runtime.start()
    await server.start()
    await server.until_ready()
    yield server
    await server.stop()
    await runtime.stop()


async def test_ways_that_fail_concern_nobody_else(running, monkeypatch):
    """As with `one_way_level.obj`: an assertion in the search of a way."""

    def fail(self, start, goal):
        raise AssertionError("a link that only one side sees")

    async with (
        wf.Client(running.grpc_address) as client,
        httpx.AsyncClient(base_url=running.http_url, timeout=10) as http,
    ):
        scene = (await http.post("/v1/scenes", json=FIELD)).json()["scene_id"]
        good = await client.create_session()
        walkers = await good.create_agents(wf.AgentSpec(), wf.AgentSpec(position=(2, 0, 0)))
        for walker in walkers:
            await good.set_goal(walker, (0.0, 0.0, 80.0))
        seqs = {walker.agent_id: [] for walker in walkers}
        told = []

        async def read():
            async for batch in good.stream():
                for frames in batch:
                    seqs[frames.agent.agent_id].append(frames.seq)
                told.extend(batch.events)

        statuses = set()

        async def probe():
            while True:
                statuses.add((await http.get("/v1/health/ready")).status_code)
                statuses.add((await http.get("/v1/health/live")).status_code)
                await asyncio.sleep(0.02)

        beside = [asyncio.create_task(read()), asyncio.create_task(probe())]
        await until(lambda: all(seqs.values()), 20)
        monkeypatch.setattr(Scene, "path", fail)
        made = (await http.post("/v1/sessions", json={"scene": scene, "seed": 5})).json()
        bad = f"/v1/sessions/{made['session_id']}"
        assert (await http.post(f"{bad}/crowd", json={"count": 8})).status_code == 200
        events = []
        async with http.stream("GET", f"/v1/events?session={made['session_id']}") as answer:
            async with asyncio.timeout(SECONDS * 3):
                async for line in answer.aiter_lines():
                    if line.startswith("event: "):
                        events.append(line.removeprefix("event: "))
                    if events.count("fault") >= 8:
                        break
        before = {name: len(own) for name, own in seqs.items()}
        await until(lambda: all(len(seqs[n]) >= before[n] + 5 for n in seqs), 20)
        for task in beside:
            assert not task.done()
            task.cancel()
        assert statuses == {200}
        for own in seqs.values():
            assert own == list(range(own[0], own[0] + len(own)))
        assert not [event for event in told if "fault" in str(event.kind).lower()]
        metrics = (await http.get("/metrics")).text
        counted = re.search(r'wayfarer_faults_total\{stage="way"\} (\S+)', metrics)
        assert counted and float(counted[1]) >= 8
        assert "wayfarer_loop_failures_total 0.0" in metrics
        agents = (await http.get(f"{bad}/agents")).json()["agents"]
        assert len(agents) == 8 and {agent["state"] for agent in agents} == {"standing"}
        monkeypatch.undo()
        goal = {"position": {"x": 6.0, "y": 0.0, "z": 6.0}}
        first = agents[0]["agent_id"]
        assert (await http.put(f"/v1/agents/{first}/goal", json=goal)).status_code == 200
        places = [agents[0]["position"]]
        async with asyncio.timeout(20):
            while places[-1] == places[0]:
                places.append((await http.get(f"/v1/agents/{first}")).json()["position"])
                await asyncio.sleep(0.1)


async def test_a_loop_that_has_ended_ends_the_process(monkeypatch):
    """A supervisor can then restart it, instead of 503 forever."""

    def runtime(settings, folder, clock, meter, ownership, ended):
        return MotionService(fake_worlds(), clock=clock, meter=meter, ended=ended)

    def fail(self, now):
        raise RuntimeError("a turn that fails for everybody")

    for name in ("settle", "share_heaps"):
        monkeypatch.setattr(f"wayfarer.serve.{name}", lambda: None)
    monkeypatch.setattr("wayfarer.serve.runtime", runtime)
    interval, loop = sys.getswitchinterval(), asyncio.get_running_loop()
    try:
        running = asyncio.create_task(serve(Settings(http_port=0, grpc_port=0)))
        await asyncio.sleep(1.0)
        assert not running.done()
        monkeypatch.setattr(MotionThread, "_keep_schedule", fail)
        with pytest.raises(Unavailable, match="the motion loop has failed, and the server ends"):
            async with asyncio.timeout(30):
                await running
    finally:
        sys.setswitchinterval(interval)
        for sign in SIGNALS:
            loop.remove_signal_handler(sign)
