"""The loop with its real thread, briefly; test_world tests time-dependent behaviour."""

import asyncio
import time

import numpy as np
import pytest

from tests.runtime.chunks import KeepingMeter
from tests.runtime.running import ALL, Running, first, give, world_of
from tests.world.fakes import GOAL, people
from wayfarer.errors import NotFound, ResourceExhausted
from wayfarer.runtime.live import steady_clock
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import ChunkFlag, SessionSpec


async def test_agents_stream_in_real_time_to_their_goal():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        stream = await loop.subscribe("s", ALL)
        agents = await loop.create_agents("s", people(4))
        assert await give(loop, agents[0].agent_id, GOAL) == 1
        batches = await first(stream, 12)
        chunks = [c for p in batches for c in p.chunks]
        for agent in agents:
            own = [c for c in chunks if c.agent_id == agent.agent_id]
            assert [c.seq for c in own] == list(range(len(own))) and len(own) >= 2
            assert own[0].flags & ChunkFlag.FIRST and own[0].alias == agent.alias
            steps = np.diff([c.scheduled_at for c in own]) / STEP_SECONDS
            np.testing.assert_allclose(steps, steps.round(), atol=1e-4)
        assert (await world_of(loop, "get_agent", agents[0].agent_id)).position[1] > 0
        stats = await loop.stats()
        assert (stats.agents, stats.sessions, stats.subscribers) == (4, 1, 1)
        assert stats.steps >= len(chunks) and stats.failures == stats.resets == 0
        assert loop.alive and loop.ready


async def test_sessions_do_not_see_each_other_and_end_their_streams():
    async with Running() as loop:
        for name in ("a", "b"):
            await loop.create_session(SessionSpec(name))
            await loop.create_agents(name, people(2))
        a, b = await loop.subscribe("a", ALL), await loop.subscribe("b", ALL)
        own = set((await world_of(loop, "get_session", "a")).agent_ids)
        assert {c.agent_id for p in await first(a, 3) for c in p.chunks} <= own
        await loop.delete_session("a")
        async with asyncio.timeout(5):
            async for _ in a:
                pass
        with pytest.raises(NotFound):
            await world_of(loop, "get_session", "a")
        assert await first(b, 3)
        assert (await loop.stats()).agents == 2


async def test_agents_may_be_deleted_at_any_moment():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        stay, *go = await loop.create_agents("s", people(8))
        stream = await loop.subscribe("s", ALL)
        for agent in go:
            await anext(stream)
            await loop.delete_agent(agent.agent_id)
            with pytest.raises(NotFound):
                await world_of(loop, "get_agent", agent.agent_id)
        while len((await anext(stream)).chunks) > 1:  # chunks sent before
            pass
        batches = await first(stream, 3)
        assert {c.agent_id for b in batches for c in b.chunks} == {stay.agent_id}
        assert [a.agent_id for a in await world_of(loop, "list_agents", "s")] == [stay.agent_id]


async def test_the_meter_is_told():
    meter = KeepingMeter()
    async with Running(meter=meter, agents=2, sessions=1) as loop:
        await loop.create_session(SessionSpec("s"))
        agent, _ = await loop.create_agents("s", people(2))
        stream = await loop.subscribe("s", ALL)
        await first(stream, 2)
        await give(loop, agent.agent_id, GOAL)
        await first(stream, 6)
        assert len(meter.goals) == 1 and 0 < meter.goals[0] < 1
        assert sum(agents for _, agents in meter.steps) >= 8
        assert len(meter.lateness) >= 8 and meter.queues
        with pytest.raises(ResourceExhausted):
            await loop.create_agents("s", people(1))
        with pytest.raises(ResourceExhausted):
            await loop.create_session(SessionSpec("t"))
        assert meter.refusals == {"create_agents": 1, "create_session": 1}


async def test_a_jump_of_the_wall_clock_changes_no_schedule(monkeypatch):
    wall = time.time
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        await loop.create_agents("s", people(1))
        stream = await loop.subscribe("s", ALL)
        got = await first(stream, 2)
        for jump in (3600.0, -86_400.0):
            monkeypatch.setattr(time, "time", lambda jump=jump: wall() + jump)
            got += await first(stream, 3)
        chunks = [c for p in got for c in p.chunks]
        assert [c.seq for c in chunks] == list(range(8))
        steps = np.diff([c.scheduled_at for c in chunks]) / STEP_SECONDS
        np.testing.assert_allclose(steps, steps.round(), atol=1e-4)
        assert steps.round().min() == 1 and steps.max() < 100, "a busy machine may skip a few"
        assert loop.alive


def test_the_clock_tells_unix_time_and_never_jumps(monkeypatch):
    clock, wall = steady_clock(), time.time
    assert clock() == pytest.approx(wall(), abs=1.0)
    monkeypatch.setattr(time, "time", lambda: 0.0)
    before = clock()
    assert before <= clock() < before + 60.0
