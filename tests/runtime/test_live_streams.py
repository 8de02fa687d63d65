"""Streams of the loop's subscribers, with its real thread."""

import asyncio

import numpy as np

from tests.runtime.running import ALL, Running, first
from tests.world.fakes import people
from wayfarer.runtime.streams.publications import SlowReader, StreamOptions
from wayfarer.world.agents.agent import ChunkFlag, SessionSpec


async def test_agents_wait_for_a_stalled_holder_and_others_do_not():
    async with Running(queue_s=0.2) as loop:
        for name in "st":
            await loop.create_session(SessionSpec(name))
        holder = await loop.subscribe("s", StreamOptions(slow_reader=SlowReader.HOLD))
        other = await loop.subscribe("t", ALL)
        for name in "st":
            await loop.create_agents(name, people(2))
        got = await first(holder, 2)
        seen = await first(other, 12)  # 1.2 s
        assert (await loop.stats()).held_sessions == 1
        got += await first(holder, 12)
        async with asyncio.timeout(10):  # a busy machine may make this reader slow again
            while (await loop.stats()).held_sessions:
                got += await first(holder, 1)
        for stream in (got, seen):
            chunks = [c for p in stream for c in p.chunks]
            for alias in (1, 2):
                own = [c for c in chunks if c.alias == alias]
                assert [c.seq for c in own] == list(range(len(own)))
                assert not any(c.flags & ChunkFlag.GAP for c in own)
        times = [c.scheduled_at for p in got for c in p.chunks if c.alias == 1]
        assert max(np.diff(times)) > 0.5, "they have stopped meanwhile"
