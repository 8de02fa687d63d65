"""The whole service except the models: real loop, servers and client, and an engine that walks."""

import asyncio
import contextlib
import math

import httpx
import numpy as np
import pytest
import websockets

import wayfarer_client as wf


@pytest.fixture
async def client(server):
    async with wf.Client(server.grpc_address) as connected:
        yield connected


async def test_a_path_is_walked_with_its_controls(client):
    """The agent passes a corner without stopping, and ends with the requested heading."""
    async with await client.create_session("unity") as session:
        (ada,) = await session.create_agents(wf.AgentSpec())
        path = [
            wf.Goal((0, 0, 1.2), speed=3.0, stop=False),
            wf.Goal((1.2, 0, 1.2), speed=3.0, heading=math.pi / 2),
        ]
        assert await session.set_path(ada, path) == 1
        assert (await session.agent(ada)).waypoints == 2
        reached, states = [], []
        async with contextlib.aclosing(session.stream()) as stream, asyncio.timeout(60):
            async for batch in stream:
                for frames in batch:
                    states.append((frames.waypoint, frames.state))
                    if wf.Flag.ARRIVED in frames.flags:
                        reached.append(frames.waypoint)
                if len(reached) == 2 and states[-1][1] == "standing":
                    break
        assert reached == [0, 1]
        assert {state for waypoint, state in states if waypoint == 0} <= {"standing", "walking"}
        assert (1, "turning") in states
        ada = await session.agent(ada)
        last = ada.goal
        assert last.position == pytest.approx((1.2, 0, 1.2))
        assert (last.radius, last.speed, last.stop) == (0.3, 3.0, True)
        assert last.heading == pytest.approx(math.pi / 2)
        assert ada.heading == pytest.approx(math.pi / 2, abs=0.3)


async def test_a_stream_survives_what_others_do(server, client):
    """Issue 2: refusals, and clients that vanish, cost the others no chunk."""
    async with await client.create_session() as session:
        (ada,) = await session.create_agents(wf.AgentSpec())
        async with contextlib.aclosing(session.stream()) as stream, asyncio.timeout(30):
            last = (await anext(stream)).frames[0]
            assert (last.seq, last.first_frame, last.flags) == (0, 0, wf.Flag.FIRST)
            with pytest.raises(wf.NotFound, match="no agent 'agent-nobody'"):
                await session.set_goal("agent-nobody", (1, 0, 1))
            for place, radius in (
                ((float("nan"), 0, 0), None),
                ((1e6, 0, 0), None),
                ((1, 0, 0), 0),
            ):
                with pytest.raises(wf.InvalidArgument, match=r"goal"):
                    await session.set_goal(ada, place, radius=radius)

            vanishing = wf.Client(server.grpc_address)
            await vanishing.connect()
            other = (await vanishing.session(session.session_id)).stream()
            await anext(other)
            await vanishing.close()
            url = f"{server.http_url.replace('http', 'ws')}/v1/stream?session={session.session_id}"
            async with websockets.connect(url) as socket:
                await socket.recv()
                socket.transport.abort()

            for _ in range(5):  # no chunk is missing, and none was discarded
                frames = (await anext(stream)).frames[0]
                assert frames.seq == last.seq + 1 and frames.flags == wf.Flag.NONE
                assert frames.first_frame == 8 * frames.seq
                late = frames.times[0] - last.times[-1] - 1 / 40
                # whole primitives are left out where the machine is too slow: later, and no gap
                np.testing.assert_allclose(late, 0.2 * round(late / 0.2), atol=1e-5)
                last = frames
            assert (await session.agent(ada)).goal is None
            async with httpx.AsyncClient(base_url=server.http_url) as http:
                while (await http.get("/v1/stats")).json()["subscribers"] != 1:
                    await asyncio.sleep(0.02)


async def test_jitter_buffer_plays_a_real_stream(client):
    async with await client.create_session() as session:
        (ada,) = await session.create_agents(wf.AgentSpec())
        await session.set_goal(ada, (0, 0, 5))
        buffer = wf.JitterBuffer()
        path = []
        async with contextlib.aclosing(session.stream()) as stream, asyncio.timeout(20):
            async for batch in stream:
                buffer.push(batch)
                if pose := buffer.sample().get(ada.agent_id):
                    path.append(pose.translation[2])
                if len(path) >= 12:
                    break
    assert path == sorted(path) and path[-1] > path[0]
