"""People of a cluster, and what their streams and steps bring whatever happens to the nodes."""

import asyncio
import time

import numpy as np
import pytest

from wayfarer.ids import group_of
from wayfarer_client import AgentSpec, Goal


class Watcher:
    """Follows one person, over whatever happens."""

    def __init__(self, session, agent, deadline=30):
        """`deadline`: seconds without a connection after which the stream fails."""
        self.session, self.agent, self._deadline = session, agent, deadline
        self.events, self.details, self.flags = [], [], []
        self.seqs = []  # of the chunks
        self.places = []  # of the hips at these
        self.heard_at = []
        self.failed = None
        self.task = asyncio.create_task(self._follow())

    @classmethod
    async def of(cls, client, scene=""):
        """Follows a new person that walks."""
        session = await client.create_session(lease=900, scene=scene)
        (agent,) = await session.create_agents(AgentSpec())
        await session.set_goal(agent, Goal((0.0, 0.0, 300.0)))
        return cls(session, agent)

    async def _follow(self):
        async with self.session.stream(deadline=self._deadline) as self.stream:
            async for batch in self.stream:
                # an agent that walks for minutes on a busy machine arrives
                met = [one for one in batch.events if one.kind != "path_done"]
                self.events += [one.kind for one in met]
                self.details += [one.detail for one in met]
                for frames in batch.frames:
                    self.flags.append(frames.flags)
                    self.seqs.append(frames.seq)
                    self.places.append(frames.translation[0])
                    self.heard_at.append(time.monotonic())

    @property
    def group(self):
        return group_of(self.session.session_id)

    async def goes_on(self, chunks=5):
        """Waits until this many more have come."""
        wanted = len(self.seqs) + chunks
        ends_at = time.monotonic() + 60
        while len(self.seqs) < wanted:
            if self.task.done():
                self.task.result()
                pytest.fail("the stream has ended as if the session had")
            if time.monotonic() > ends_at:
                agent = await self.session.agent(self.agent)
                pytest.fail(
                    f"{wanted - len(self.seqs)} chunks of {agent} are missing, after "
                    f"{self.seqs[-1:]}, {self.events}, {self.stream.resume_token}"
                )
            await asyncio.sleep(0.02)

    def clear(self):
        for seen in (self.events, self.details, self.flags):
            seen.clear()
        for seen in (self.seqs, self.places, self.heard_at):
            seen.clear()

    async def close(self):
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)


async def go_on(watchers, chunks=5):
    """Waits until this many more chunks (0.2 s each) have come to each of them."""
    await asyncio.gather(*(one.goes_on(chunks) for one in watchers))


class Stepped:
    """Two people in lock-step in a scene. The same people do the same on any node."""

    @classmethod
    async def of(cls, client, scene):
        self = cls()
        self.twins = [
            await client.create_session(lease=900, lock_step=True, scene=where)
            for where in (scene, scene)
        ]
        for session in self.twins:
            people = [AgentSpec(seed=seed, position=(2, 0, 3 * seed)) for seed in (1, 2)]
            for agent in await session.create_agents(*people):
                await session.set_goal(agent, Goal((2.0, 0.0, 200.0)))
        self.steps = []
        return self

    async def goes_on(self):
        """Both make the same step, and it is the next one."""
        (batch,), (other,) = [await session.step() for session in self.twins]
        for one, same in zip(batch.frames, other.frames, strict=True):
            assert np.array_equal(one.rotations, same.rotations)
            assert np.array_equal(one.times, same.times)
        self.steps.append([(frames.seq, frames.times[0]) for frames in batch.frames])
        assert np.allclose(np.diff(self.steps, axis=0), (1, 0.2)), self.steps
