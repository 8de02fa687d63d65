"""`wayfarer serve --workers 2` as processes, with the shipped model, and the Python client."""

import asyncio
import os
import signal
import socket
from contextlib import closing

import httpx
import psutil
import pytest

import wayfarer_client as wf
from tests.serving import Service
from wayfarer.workers.shares import worker_of

TWO = ("--workers", "2", "--engine", "onnxruntime")


async def watch(session: wf.Session, chunks: int, token: str = "") -> tuple[dict, str, list]:
    """The last place of each agent, the token to go on with, events."""
    last, events, taken = {}, [], 0
    async with asyncio.timeout(120), session.stream(resume_token=token) as stream:
        async for batch in stream:
            events += batch.events
            for frames in batch:
                last[frames.agent.agent_id] = frames.translation[-1]
                taken += 1
            if taken >= chunks:
                break
    return last, stream.resume_token, events


def pids(service: Service) -> list[int]:
    """Of the workers: the children of the server."""
    return [child.pid for child in psutil.Process(service.process.pid).children()]


async def ready(service: Service) -> None:
    async with asyncio.timeout(300), httpx.AsyncClient() as http:
        while (await http.get(f"{service.url}/v1/health/ready")).status_code != 200:
            await asyncio.sleep(0.2)


async def test_two_workers_are_one_server_and_outlive_a_kill(tmp_path):
    with Service(*TWO, "--state-dir", str(tmp_path)) as service:
        async with (
            wf.Client(service.grpc_address, timeout=60) as client,
            wf.Client(service.grpc_address, timeout=60, direct=False) as relayed,
        ):
            sessions = [await client.create_session(lease=600) for _ in range(2)]
            homes = [worker_of(session.session_id, 2) for session in sessions]
            assert sorted(homes) == [0, 1], "sessions are spread"
            people = [
                (await session.create_agents(wf.AgentSpec(seed=1)))[0] for session in sessions
            ]
            for session, person in zip(sessions, people, strict=True):
                assert worker_of(person.agent_id, 2) == worker_of(session.session_id, 2)
                await session.set_goal(person, (0.0, 0.0, 40.0))
                # straight to its worker, and through the front
                assert session._connection is not client.connection
                assert await watch(session, 2)
            through = [await relayed.session(session.session_id) for session in sessions]
            assert {session._connection for session in through} == {relayed.connection}
            tokens = [(await watch(session, 4))[1] for session in through]
            assert {s.session_id for s in await client.sessions()} == {
                s.session_id for s in sessions
            }

            wrong = sessions[0]._connection.sessions.GetSession
            other = wf.client.session_pb2.GetSessionRequest(session_id=sessions[1].session_id)
            sent_on = await sessions[0]._connection.call(wrong, other)
            assert sent_on.session.session_id == sessions[1].session_id, "the client follows"

            before = [
                await session.agent(person)
                for session, person in zip(sessions, people, strict=True)
            ]
            os.kill(sorted(pids(service))[homes[0]], signal.SIGKILL)  # started in their order
            # the other one walks on meanwhile, and nothing of it is lost
            _, _, events = await watch(sessions[1], 5, tokens[1])
            assert events == []
            await ready(service)
            after, _, events = await watch(sessions[0], 5, tokens[0])
            assert [event.kind for event in events] == ["gap"], "it has a new epoch"
            agent = await through[0].agent(people[0])
            assert agent.goal_revision == before[0].goal_revision == 1
            assert agent.position[2] >= before[0].position[2] - 1.0 and set(after) == {
                agent.agent_id
            }
            page = httpx.get(f"{service.url}/metrics").text
            restarts = f'wayfarer_worker_restarts_total{{worker="{homes[0]}"}} 1.0'
            assert restarts in page
            assert f'wayfarer_worker_restarts_total{{worker="{homes[1]}"}} 0.0' in page
        workers = pids(service)
        service.process.send_signal(signal.SIGTERM)
        assert service.process.wait(timeout=120) == 0
        for pid in workers:
            with pytest.raises(ProcessLookupError):
                os.kill(pid, 0)


async def test_an_admin_drains_them_all():
    with Service(*TWO) as service:
        async with wf.Client(service.grpc_address, timeout=30) as client:
            await client.admin.drain()
        assert service.process.wait(timeout=120) == 0


async def test_workers_do_not_outlive_their_supervisor():
    with Service(*TWO) as service:
        workers = pids(service)
        assert len(workers) == 2
        service.process.kill()
        service.process.wait()
        async with asyncio.timeout(120):
            while any(alive(pid) for pid in workers):
                await asyncio.sleep(0.1)


def alive(pid: int) -> bool:
    """What has ended may stay a zombie where there is no init."""
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def test_a_workers_port_in_use_is_told():
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(RuntimeError, match="cannot listen for gRPC on 127"):
            Service(*TWO, "--grpc-port", str(port - 2))
