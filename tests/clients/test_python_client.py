"""The Python client against the real server: what its README promises."""

import asyncio

import numpy as np
import pytest

import wayfarer_client as wf


@pytest.fixture
async def client(real_server):
    async with wf.Client(real_server.grpc_address) as connected:
        yield connected


async def test_a_stream_resumes_after_a_goal_change(client):
    async with await client.create_session(seed=3) as session:
        ada, bo = await session.create_agents(
            wf.AgentSpec(name="Ada"), wf.AgentSpec(name="Bo", gender="male", position=(2, 0, 0))
        )
        assert await session.set_goal(ada, (0, 0, 3)) == 1
        assert await session.wander(bo, (0, 0, 0), 4.0) == 1
        seen: dict[str, list[int]] = {"Ada": [], "Bo": []}
        async with session.stream(format=wf.PoseFormat("f16_le", fps=20)) as stream:
            async for batch in stream:
                for frames in batch:
                    seen[frames.agent.name].append(frames.seq)
                    np.testing.assert_allclose(np.diff(frames.times), 0.05, atol=1e-6)
                if min(map(len, seen.values())) >= 5:
                    break
        assert await session.append_goals(ada, [wf.Goal((1, 0, 3))], expected=1) == 2
        await asyncio.sleep(0.5)
        async with session.stream(resume_token=stream.resume_token) as rest:
            async for batch in rest:
                for frames in batch:
                    seen[frames.agent.name].append(frames.seq)
                if min(map(len, seen.values())) >= 12:
                    break
            assert rest.info.resumed
        for numbers in seen.values():
            assert numbers == list(range(len(numbers)))


async def test_control_answers_beside_the_motion(client):
    async with await client.create_session() as session:
        (ada,) = await session.create_agents(wf.AgentSpec())
        async with session.control([ada]) as control:
            assert await control.set_goal(ada, (0, 0, 2)) == 1
            with pytest.raises(wf.Aborted):
                await control.clear_goal(ada, expected=7)
            batches = [await anext(control) for _ in range(5)]
            assert [f.seq for batch in batches for f in batch] == list(range(5))


async def test_lock_step_replays_bit_for_bit(client, tmp_path):
    async with await client.create_session(lock_step=True, record=True, seed=5) as session:
        (ada,) = await session.create_agents(wf.AgentSpec(name="Ada"))
        await session.set_goal(ada, (0, 0, 2))
        batches = await session.step(10)
        track = wf.tracks(batches)[ada.agent_id]
        assert len(track.times) == 80 and np.allclose(np.diff(track.times), 0.025)
        log = await session.export_log()
    again = wf.tracks([batch async for batch in client.replay(log)])[ada.agent_id]
    np.testing.assert_array_equal(again.translation, track.translation)
    np.testing.assert_array_equal(again.rotations, track.rotations)
    assert track.save(tmp_path / "ada").exists()


async def test_a_clip_ends_at_its_goal(client):
    clip = client.generate_clip(
        wf.AgentSpec(), [wf.Goal((0, 0, 2))], 10.0, until_arrival=True, basis="unity"
    )
    (track,) = wf.tracks([batch async for batch in clip]).values()
    assert track.times[0] == 0 and track.times[-1] < 9
    assert np.hypot(*(track.translation[-1] - (0, 0, 2))[[0, 2]]) < 0.5
