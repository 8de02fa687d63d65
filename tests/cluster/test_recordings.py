"""A recorded session whose node is killed goes on being recorded, after what was before."""

import asyncio

import numpy as np
import pytest

from tests.cluster.local import LocalCluster
from tests.serving import needs_ray
from wayfarer_client import AgentSpec, Client, Goal

pytestmark = [pytest.mark.slow, needs_ray]


class Seen:
    """What a stream has brought."""

    def __init__(self, session):
        self.session = session
        self.frames = []
        self.gaps = 0
        self.task = asyncio.create_task(self._follow())

    async def _follow(self):
        async with self.session.stream(deadline=30) as stream:
            async for batch in stream:
                self.gaps += any(event.kind == "gap" for event in batch.events)
                self.frames += batch.frames

    async def goes_on(self, chunks):
        wanted = len(self.frames) + chunks
        async with asyncio.timeout(60):
            while len(self.frames) < wanted:
                assert not self.task.done(), self.task
                await asyncio.sleep(0.05)

    async def close(self):
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)


async def test_the_log_of_a_session_outlives_its_node():
    async with LocalCluster() as cluster, Client(cluster.entry.grpc_address) as client:
        session = await client.create_session(lease=900, record=True)
        ada, bob = await session.create_agents(AgentSpec(seed=1), AgentSpec(seed=2))
        await session.set_goal(ada, Goal((0.0, 0.0, 300.0)))
        seen = Seen(session)
        await seen.goes_on(20)
        await session.set_goal(bob, Goal((9.0, 0.0, 9.0)))
        await seen.goes_on(20)
        for gaps in (1, 2):  # its neighbour is killed, too
            await asyncio.sleep(2.5)  # it is copied
            view = cluster.entry.finder._view
            name = view.owner(session.session_id).name
            (await cluster.process(name)).kill()
            async with asyncio.timeout(60):
                while seen.gaps < gaps:
                    await asyncio.sleep(0.05)
            await session.set_goal(ada, Goal((-20.0 * gaps, 0.0, 0.0)))
            await seen.goes_on(40)
            assert view.owner(session.session_id).name != name
        log = await session.export_log()
        await seen.close()
        played = {}
        async for batch in client.replay(log):
            for frames in batch.frames:
                played[frames.agent.agent_id, frames.seq] = frames
        for agent in (ada, bob):
            seqs = sorted(seq for name, seq in played if name == agent.agent_id)
            assert seqs == list(range(len(seqs))), "without a hole"
        void = 0
        for frames in seen.frames:
            same = played.get((frames.agent.agent_id, frames.seq))
            if same is None or abs(same.times[0] - frames.times[0]) > 1e-3:
                void += 1  # made by a node that died before it had copied it
                continue
            assert np.array_equal(same.translation, frames.translation), frames
            assert np.array_equal(same.rotations, frames.rotations), frames
            assert (same.state, same.goal_revision) == (frames.state, frames.goal_revision)
        lost_s = 2.5  # at each death, at most
        assert void <= 2 * 2 * lost_s / 0.2, f"{void} of {len(seen.frames)} chunks"
        times = [
            frames.times[0] for (name, _), frames in sorted(played.items()) if name == ada.agent_id
        ]
        assert sum(np.diff(times) > 0.3) == 2, "the log shows when it lived on"
