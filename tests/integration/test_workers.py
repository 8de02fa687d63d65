"""`wayfarer serve --workers 2` as processes, with the shipped model, and the Python client."""

import asyncio
import contextlib
import signal
import time
from collections.abc import Callable

import httpx
import psutil
import pytest

import wayfarer_client as wf
from tests.cluster.local import lives
from tests.serving import Service, needs_ray

pytestmark = needs_ray

TWO = ("--workers", "2", "--engine", "onnxruntime")


class Watch:
    """Follows a session through all disturbances."""

    def __init__(self, session: wf.Session):
        self.session, self.events, self.places = session, [], []
        self.task = asyncio.create_task(self._follow())

    async def _follow(self) -> None:
        async with self.session.stream(deadline=60) as self.stream:
            async for batch in self.stream:
                self.events += [event.kind for event in batch.events]
                self.places += [frames.translation[-1] for frames in batch]

    async def goes_on(self, chunks: int = 5) -> None:
        wanted = len(self.places) + chunks
        await self._until(lambda: len(self.places) >= wanted)

    async def has_a_gap(self) -> None:
        """Chunks sent before a node's death may arrive after it, so this waits."""
        await self._until(lambda: "gap" in self.events)

    async def _until(self, true: Callable[[], bool]) -> None:
        async with asyncio.timeout(60):
            while not true() and not self.task.done():
                await asyncio.sleep(0.02)
        if self.task.done():
            self.task.result()
            pytest.fail("the stream has ended as if the session had")

    async def close(self) -> None:
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)


def nodes(service: Service) -> list[psutil.Process]:
    """The nodes' processes."""
    below = psutil.Process(service.process.pid).children(recursive=True)
    return [one for one in below if "NodeActor" in " ".join(one.cmdline())]


async def endpoint(service: Service, session: wf.Session) -> dict[str, int]:
    """Endpoint of the session's node, from the entry."""
    async with httpx.AsyncClient() as http:
        answer = await http.get(f"{service.url}/v1/sessions/{session.session_id}")
    assert answer.status_code == 421
    found: dict[str, int] = answer.json()["endpoint"]
    return found


async def home(service: Service, session: wf.Session) -> int:
    """Number of the session's node."""
    return (await endpoint(service, session))["worker"]


async def kill(service: Service, session: wf.Session) -> None:
    """Kills the session's node."""
    port = (await endpoint(service, session))["http_port"]
    for one in nodes(service):
        if port in [found.laddr.port for found in one.net_connections()]:
            one.kill()


async def people(session: wf.Session) -> list[str]:
    """Ids of the session's agents, once its node is back."""
    async with asyncio.timeout(120):
        while True:
            with contextlib.suppress(wf.Unavailable):
                return [agent.agent_id for agent in await session.agents()]
            await asyncio.sleep(0.1)


async def test_two_nodes_are_one_server_whose_sessions_outlive_a_kill_and_a_restart(tmp_path):
    with Service(*TWO, "--state-dir", str(tmp_path)) as service:
        async with wf.Client(service.grpc_address, timeout=60) as client:
            scene = await client.scenes.example("corridor")
            inside = await client.create_session(lease=600, scene=scene)
            await inside.create_agents(wf.AgentSpec(seed=1))
            sessions = [await client.create_session(lease=600) for _ in range(2)]
            for session in sessions:
                (person,) = await session.create_agents(wf.AgentSpec(seed=1))
                await session.set_goal(person, (0.0, 0.0, 40.0))
            everybody = {one.session_id: one for one in (inside, *sessions)}
            homes = {name: await home(service, one) for name, one in everybody.items()}
            assert set(homes.values()) == {0, 1}, "sessions are spread"
            assert {one.session_id for one in await client.sessions()} == set(everybody)
            assert len(await client.scenes.all()) == 1

            killed = homes[sessions[0].session_id]
            there = [one for name, one in everybody.items() if homes[name] == killed]
            here = [one for name, one in everybody.items() if homes[name] != killed]
            watched = {one.session_id: Watch(one) for one in everybody.values()}
            for one in watched.values():
                await one.goes_on()
            late = [(await one.create_agents(wf.AgentSpec()))[0] for one in there]
            await kill(service, sessions[0])
            for one in there:  # acknowledged commands are on disk, and wait for their node
                assert late[there.index(one)].agent_id in await people(one)
            for one in there:
                await watched[one.session_id].has_a_gap()
            for one in everybody.values():
                await watched[one.session_id].goes_on()
            for one in here:
                assert watched[one.session_id].stream.reconnections == 0, "they do not notice"
            assert {name: await home(service, one) for name, one in everybody.items()} == homes
            for one in watched.values():
                await one.close()
        below = nodes(service)
        service.process.kill()
        assert not psutil.wait_procs(below, timeout=120)[1], "nodes outlive their parent"

    with Service(*TWO, "--state-dir", str(tmp_path)) as service:
        async with wf.Client(service.grpc_address, timeout=60) as client:
            back = {one.session_id: one for one in await client.sessions()}
            assert set(back) == set(everybody)
            assert len(await client.scenes.all()) == 1
            for name, one in back.items():
                assert await home(service, one) == homes[name]
                watch = Watch(one)
                await watch.goes_on(1)
                await watch.close()
        ends_at_once(service)


def ends_at_once(service: Service) -> None:
    """By Ctrl-C, while Ray is well; a second one does no harm."""
    below = psutil.Process(service.process.pid).children(recursive=True)
    service.process.send_signal(signal.SIGINT)
    time.sleep(1)
    service.process.send_signal(signal.SIGINT)
    assert service.process.wait(timeout=120) == 0
    assert not [one for one in psutil.wait_procs(below, timeout=0.5)[1] if lives(one)]
    service.stop()
    told = "".join(service.said)
    assert "Traceback" not in told and "did not end" not in told, told
