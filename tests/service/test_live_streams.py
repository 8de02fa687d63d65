"""What the loop's subscribers get, with its real thread."""

import asyncio
import gc

import numpy as np
import pytest

from tests.service.chunks import KeepingMeter
from tests.service.running import ALL, Running, first
from tests.world.fakes import people
from wayfarer.errors import InvalidArgument
from wayfarer.service.streams.publications import Resume, SlowReader, StreamOptions
from wayfarer.world.agents.agent import ChunkFlag, Goal, SessionSpec
from wayfarer.world.events import EventKind
from wayfarer.world.goals.commands import Path


async def test_a_subscription_may_name_agents():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        agents = await loop.create_agents("s", people(4))
        stream = await loop.subscribe("s", StreamOptions((agents[2].agent_id,)))
        batches = await first(stream, 3)
        assert [[c.agent_id for c in b.chunks] for b in batches] == [[agents[2].agent_id]] * 3


async def test_a_slow_subscriber_gets_a_gap_and_the_other_nothing_of_it():
    async with Running(queue_s=0.2) as loop:
        await loop.create_session(SessionSpec("s"))
        await loop.create_agents("s", people(1))
        slow, quick = await loop.subscribe("s", ALL), await loop.subscribe("s", ALL)
        await first(slow, 1)
        seqs = [b.chunks[0].seq for b in await first(quick, 7)]
        assert seqs == list(range(7))
        told, publication = await first(slow, 2)
        assert [e.kind for e in told.events] == [EventKind.GAP]
        [late] = publication.chunks
        assert late.flags & ChunkFlag.GAP and late.seq > 1
        assert (await loop.stats()).dropped_batches > 0


async def test_closed_and_vanished_subscribers_are_forgotten():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        await loop.create_agents("s", people(1))
        closed, vanished, reading = [await loop.subscribe("s", ALL) for _ in range(3)]
        assert (await loop.stats()).subscribers == 3
        await closed.close()
        del vanished
        gc.collect()
        assert await first(reading, 2)
        assert (await loop.stats()).subscribers == 1


async def test_a_stream_is_resumed_after_its_connection():
    meter = KeepingMeter()
    async with Running(meter=meter) as loop:
        await loop.create_session(SessionSpec("s"))
        await loop.create_agents("s", people(3))
        stream = await loop.subscribe("s", ALL)
        got = await first(stream, 4)
        await stream.close()
        await asyncio.sleep(0.5)
        resume = Resume(stream.epoch, got[-1].position)
        again = await loop.subscribe("s", StreamOptions(resume=resume))
        got += await first(again, 20)
        assert again.resumed and [p.position for p in got] == list(range(1, 25))
        for alias in (1, 2, 3):
            own = [c for p in got for c in p.chunks if c.alias == alias]
            assert [c.seq for c in own] == list(range(len(own)))
            assert [bool(c.flags & ChunkFlag.FIRST) for c in own] == [True, *[False] * len(own[1:])]
        assert meter.resumes == {"resumed": 1}


async def test_the_session_of_the_same_name_is_another_epoch():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        stream = await loop.subscribe("s", ALL)
        await loop.delete_session("s")
        await loop.create_session(SessionSpec("s"))
        again = await loop.subscribe("s", StreamOptions(resume=Resume(stream.epoch, 0)))
        assert not again.resumed
        [told] = await first(again, 1)
        assert [e.kind for e in told.events] == [EventKind.GAP]
        with pytest.raises(InvalidArgument, match="position is 5; allowed: 0 to 0"):
            await loop.subscribe("s", StreamOptions(resume=Resume(again.epoch, 5)))


async def test_goals_reached_and_paths_done_are_told():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        [agent] = await loop.create_agents("s", people(1))
        stream = await loop.subscribe("s", ALL)
        path = (Goal((0.0, 0.5, 0.0), stop=False, speed=2.0), Goal((0.0, 1.0, 0.0), speed=2.0))
        await loop.give(agent.agent_id, Path(path))
        told = []
        async with asyncio.timeout(10):
            while EventKind.PATH_DONE not in [event.kind for event in told]:
                told += (await anext(stream)).events
        reached, done = EventKind.GOAL_REACHED, EventKind.PATH_DONE
        assert [(e.kind, e.waypoint) for e in told] == [(reached, 0), (reached, 1), (done, 1)]
        assert {(e.agent_id, e.alias, e.goal_revision) for e in told} == {
            (agent.agent_id, agent.alias, 1)
        }


async def test_agents_wait_for_a_stalled_holder_and_others_do_not():
    async with Running(queue_s=0.2) as loop:
        for name in "st":
            await loop.create_session(SessionSpec(name))
            await loop.create_agents(name, people(2))
        holder = await loop.subscribe("s", StreamOptions(slow_reader=SlowReader.HOLD))
        other = await loop.subscribe("t", ALL)
        got = await first(holder, 2)
        seen = await first(other, 12)  # 1.2 s
        assert (await loop.stats()).held_sessions == 1
        got += await first(holder, 12)
        async with asyncio.timeout(10):  # a busy machine may make this reader slow once more
            while (await loop.stats()).held_sessions:
                got += await first(holder, 1)
        for stream in (got, seen):
            chunks = [c for p in stream for c in p.chunks]
            for alias in (1, 2):
                own = [c for c in chunks if c.alias == alias]
                assert [c.seq for c in own] == list(range(len(own)))
                assert not any(c.flags & ChunkFlag.GAP for c in own)
        times = [c.scheduled_at for p in got for c in p.chunks if c.alias == 1]
        assert max(np.diff(times)) > 0.5, "they have stood still meanwhile"
        assert (await loop.stats()).rebased == 0
