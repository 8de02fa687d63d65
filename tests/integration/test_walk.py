"""The whole service but for the models: real loop, servers and client; an engine that walks."""

import asyncio
import contextlib
import math
from dataclasses import replace

import httpx
import numpy as np
import pytest
import websockets

import wayfarer_client as wf
from wayfarer.v1 import control_pb2, motion_pb2


@pytest.fixture
async def client(server):
    async with wf.Client(server.grpc_address) as connected:
        yield connected


async def follow(session: wf.Session, until: int) -> list[wf.Frames]:
    """Frames of one agent until so many chunks have come."""
    found: list[wf.Frames] = []
    async with contextlib.aclosing(session.stream()) as stream, asyncio.timeout(20):
        async for batch in stream:
            found += batch.frames
            if len(found) >= until:
                break
    return found


async def test_people_arrive_at_three_goals_in_turn(client):
    async with await client.create_session("ros") as session:
        people = await session.create_agents(
            *(wf.AgentSpec(seed=i, position=(i, 0, 0)) for i in range(4))
        )
        goals = {
            p.agent_id: [(i, 0.6, 0), (i + 0.6, 0.6, 0), (i, 0, 0)] for i, p in enumerate(people)
        }
        for person in people:
            await session.set_goal(person, goals[person.agent_id][0], speed=2.5)
        reached = dict.fromkeys(goals, 0)
        async with contextlib.aclosing(session.stream()) as stream, asyncio.timeout(60):
            async for batch in stream:
                for frames in batch:
                    who = frames.agent.agent_id
                    is_new = frames.goal_revision == reached[who] + 1
                    if wf.Flag.ARRIVED not in frames.flags or not is_new:
                        continue
                    goal = goals[who][reached[who]]
                    assert np.linalg.norm(frames.translation[-1, :2] - goal[:2]) < 0.4
                    reached[who] += 1
                    if reached[who] < 3:
                        await session.set_goal(who, goals[who][reached[who]], speed=2.5)
                if min(reached.values()) == 3:
                    break
        assert set(reached.values()) == {3}


async def test_a_path_is_walked_with_its_controls(client):
    """Through a corner without stopping, and at the end the heading that was asked for."""
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
        assert ada.goal == replace(path[1], radius=0.3)
        assert ada.heading == pytest.approx(math.pi / 2, abs=0.3)


async def test_frames_follow_each_other_without_a_hole(client):
    async with await client.create_session() as session:
        await session.create_agents(wf.AgentSpec())
        found = await follow(session, 6)
    assert [f.seq for f in found] == list(range(found[0].seq, found[0].seq + len(found)))
    assert [f.first_frame for f in found] == [8 * f.seq for f in found]
    assert found[0].flags == wf.Flag.FIRST and all(f.flags == wf.Flag.NONE for f in found[1:])
    times = np.concatenate([f.times for f in found])
    np.testing.assert_allclose(np.diff(times), 1 / 40, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(found[0].rotations, axis=-1), 1, atol=1e-5)


async def test_a_stream_survives_what_others_do(server, client):
    """Issue 2: unknown agent, goals that are no numbers or 10 km away, vanishing clients."""
    async with await client.create_session() as session:
        (ada,) = await session.create_agents(wf.AgentSpec())
        async with contextlib.aclosing(session.stream()) as stream, asyncio.timeout(30):
            last = (await anext(stream)).frames[0]

            with pytest.raises(wf.NotFound, match="no agent 'agent-nobody'"):
                await session.set_goal("agent-nobody", (1, 0, 1))
            for bad in (float("nan"), float("inf"), float("-inf")):
                with pytest.raises(wf.InvalidArgument, match=r"goal\.position\.x: .*finite"):
                    await session.set_goal(ada, (bad, 0, 0))
            for far in (10_000.0, 1e6, 1e300):
                with pytest.raises(wf.InvalidArgument, match=r"goal(\.position)? .*allowed"):
                    await session.set_goal(ada, (far, 0, 0))
            for radius, speed in ((0.0, None), (-1.0, None), (None, 99.0)):
                with pytest.raises(wf.InvalidArgument, match=r"goal\.(radius|speed)"):
                    await session.set_goal(ada, (1, 0, 0), radius=radius, speed=speed)

            vanishing = wf.Client(server.grpc_address)
            await vanishing.connect()
            other = (await vanishing.session(session.session_id)).stream()
            await anext(other)
            await vanishing.close()
            url = f"{server.http_url.replace('http', 'ws')}/v1/stream?session={session.session_id}"
            async with websockets.connect(url) as socket:
                await socket.recv()
                socket.transport.abort()

            for _ in range(5):  # not a chunk is missing, and none was thrown away
                frames = (await anext(stream)).frames[0]
                assert frames.seq == last.seq + 1 and frames.flags == wf.Flag.NONE
                last = frames
            assert (await session.agent(ada)).goal is None
            async with httpx.AsyncClient(base_url=server.http_url) as http:
                while (await http.get("/v1/stats")).json()["subscribers"] != 1:
                    await asyncio.sleep(0.02)


async def test_limits_of_the_runtime_reach_the_client(client):
    session = await client.create_session()
    with pytest.raises(wf.ResourceExhausted, match="32"):
        await session.create_agents(*[wf.AgentSpec()] * 33)
    for _ in range(3):
        await client.create_session()
    with pytest.raises(wf.ResourceExhausted, match="4 sessions"):
        await client.create_session()


async def test_websocket_and_grpc_show_the_same_motion(server, client):
    async with await client.create_session("unity") as session:
        await session.create_agents(wf.AgentSpec(seed=3))
        url = f"{server.http_url.replace('http', 'ws')}/v1/stream?session={session.session_id}"
        both = asyncio.create_task(follow(session, 8))
        seen = 0
        async with websockets.connect(url) as socket, asyncio.timeout(20):
            by_socket = {}
            while seen < 6:
                message = motion_pb2.StreamMotionResponse.FromString(await socket.recv())
                if message.batch.HasField("chunks"):
                    (seq,) = message.batch.chunks.seqs
                    by_socket[seq] = message.batch.chunks
                    seen += 1
        by_grpc = {f.seq: f for f in await both}
    shared = set(by_grpc) & set(by_socket)
    assert len(shared) >= 3
    for seq in shared:
        packed = np.frombuffer(by_socket[seq].poses, "<f4").reshape(8, 91)
        np.testing.assert_array_equal(packed[:, :3], by_grpc[seq].translation)
        np.testing.assert_array_equal(packed[:, 3:].reshape(8, 22, 4), by_grpc[seq].rotations)


async def test_a_click_on_a_table_is_walked_to_by_every_way_of_asking(server, client):
    """Goals at the height of hips, over gRPC, HTTP and WebSocket."""
    async with await client.create_session("unity") as session:
        people = await session.create_agents(wf.AgentSpec(), wf.AgentSpec(), wf.AgentSpec())
        by_grpc, by_http, by_socket = (person.agent_id for person in people)
        await session.set_goal(by_grpc, (1, 0.9, 1))
        async with httpx.AsyncClient(base_url=server.http_url) as http:
            goal = {"position": {"x": 1, "y": 0.9, "z": 1}}
            answer = await http.put(f"/v1/agents/{by_http}/goal", json=goal)
            assert answer.is_success
        url = f"{server.http_url.replace('http', 'ws')}/v1/control"
        async with websockets.connect(url) as socket, asyncio.timeout(20):
            ask = control_pb2.ControlRequest(open={"session_id": session.session_id})
            await socket.send(ask.SerializeToString())
            ask = control_pb2.ControlRequest(set_goal={"agent_id": by_socket, "goal": goal})
            await socket.send(ask.SerializeToString())
            answered = control_pb2.ControlResponse()
            while not answered.HasField("reply"):
                answered.ParseFromString(await socket.recv())
        for person in people:
            told = (await session.agent(person)).goal
            assert told is not None and told.position == (1, 0, 1)


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
