"""The loop with its real thread, for moments; what depends on time is tested in test_world."""

import asyncio
import gc
import math
import threading

import numpy as np
import pytest

from tests.runtime.fakes import FakeEngine, make_world, people
from wayfarer.errors import InvalidArgument, NotFound, Unavailable
from wayfarer.runtime.agent import ChunkFlag, Goal
from wayfarer.runtime.loop import FAILURES, LoopSettings, MotionLoop

GOAL = Goal((0.0, 5.0, 0.0))


class Running:
    """`async with Running() as loop`: started, ready, and stopped at the end."""

    def __init__(self, engine=None, **settings):
        self.loop = MotionLoop(make_world(engine), settings=LoopSettings(**settings))

    async def __aenter__(self):
        self.loop.start()
        await until(lambda: self.loop.ready)
        return self.loop

    async def __aexit__(self, *_):
        await self.loop.stop()
        assert "motion-loop" not in {t.name for t in threading.enumerate()}


async def until(condition, seconds=5.0):
    async with asyncio.timeout(seconds):
        while not condition():
            await asyncio.sleep(0.005)


async def first(queue, count):
    async with asyncio.timeout(5):
        return [await anext(queue) for _ in range(count)]


async def test_agents_stream_in_real_time_to_their_goal():
    async with Running() as loop:
        await loop.create_session("s")
        agents = await loop.create_agents("s", people(4))
        stream = await loop.subscribe("s")
        assert await loop.set_goal(agents[0].agent_id, GOAL) == 1
        batches = await first(stream, 12)
        chunks = [c for batch in batches for c in batch]
        for agent in agents:
            own = [c for c in chunks if c.agent_id == agent.agent_id]
            assert [c.seq for c in own] == list(range(len(own))) and len(own) >= 2
            assert own[0].flags & ChunkFlag.FIRST and own[0].alias == agent.alias
            np.testing.assert_allclose(np.diff([c.scheduled_at for c in own]), 0.2, atol=1e-6)
        assert (await loop.get_agent(agents[0].agent_id)).position[1] > 0
        stats = await loop.stats()
        assert (stats.agents, stats.sessions, stats.subscribers) == (4, 1, 1)
        assert stats.steps >= len(chunks) and stats.failures == stats.rebased == stats.resets == 0
        assert loop.alive and loop.ready


async def test_errors_come_back_to_the_caller_and_disturb_nobody():
    async with Running() as loop:
        await loop.create_session("s")
        [agent] = await loop.create_agents("s", people(1))
        stream = await loop.subscribe("s")
        for goal in (Goal((math.nan, 0, 0)), Goal((math.inf, 0, 0)), Goal((9_999.0, 0, 0))):
            with pytest.raises(InvalidArgument, match="allowed"):
                await loop.set_goal(agent.agent_id, goal)
        for call in (
            loop.set_goal("nobody", GOAL),
            loop.clear_goal("nobody"),
            loop.get_session("nowhere"),
            loop.create_agents("nowhere", people(1)),
            loop.list_agents("nowhere"),
            loop.subscribe("nowhere"),
            loop.subscribe("s", ["nobody"]),
        ):
            with pytest.raises(NotFound, match="no"):
                await call
        assert [b[0].seq for b in await first(stream, 3)] == [0, 1, 2]
        assert loop.ready


async def test_a_subscription_may_name_agents():
    async with Running() as loop:
        await loop.create_session("s")
        agents = await loop.create_agents("s", people(4))
        stream = await loop.subscribe("s", [agents[2].agent_id])
        batches = await first(stream, 3)
        assert [[c.agent_id for c in b] for b in batches] == [[agents[2].agent_id]] * 3


async def test_sessions_do_not_see_each_other_and_end_their_streams():
    async with Running() as loop:
        for name in ("a", "b"):
            await loop.create_session(name)
            await loop.create_agents(name, people(2))
        a, b = await loop.subscribe("a"), await loop.subscribe("b")
        own = set((await loop.get_session("a")).agent_ids)
        assert {c.agent_id for batch in await first(a, 3) for c in batch} <= own
        await loop.delete_session("a")
        async with asyncio.timeout(5):
            async for _ in a:
                pass
        with pytest.raises(NotFound):
            await loop.get_session("a")
        assert await first(b, 3)
        assert (await loop.stats()).agents == 2


async def test_agents_may_be_deleted_at_any_moment():
    async with Running() as loop:
        await loop.create_session("s")
        stay, *go = await loop.create_agents("s", people(8))
        stream = await loop.subscribe("s")
        for agent in go:
            await anext(stream)
            await loop.delete_agent(agent.agent_id)
            with pytest.raises(NotFound):
                await loop.get_agent(agent.agent_id)
        while len(await anext(stream)) > 1:  # what was sent before
            pass
        batches = await first(stream, 3)
        assert {c.agent_id for b in batches for c in b} == {stay.agent_id}
        assert [a.agent_id for a in await loop.list_agents("s")] == [stay.agent_id]


async def test_a_slow_subscriber_gets_a_gap_and_the_other_nothing_of_it():
    async with Running(queue_seconds=0.2) as loop:
        await loop.create_session("s")
        await loop.create_agents("s", people(1))
        slow, quick = await loop.subscribe("s"), await loop.subscribe("s")
        await first(slow, 1)
        seqs = [b[0].seq for b in await first(quick, 7)]
        assert seqs == list(range(7))
        [[late]] = await first(slow, 1)
        assert late.flags & ChunkFlag.GAP and late.seq > 1
        assert (await loop.stats()).dropped_batches > 0


async def test_closed_and_vanished_subscribers_are_forgotten():
    async with Running() as loop:
        await loop.create_session("s")
        await loop.create_agents("s", people(1))
        closed, vanished, reading = [await loop.subscribe("s") for _ in range(3)]
        assert (await loop.stats()).subscribers == 3
        await closed.close()
        del vanished
        gc.collect()
        assert await first(reading, 2)
        assert (await loop.stats()).subscribers == 1


async def test_a_cancelled_caller_does_no_harm():
    async with Running() as loop:
        await loop.create_session("s")
        waiting = [asyncio.ensure_future(loop.get_session("s")) for _ in range(20)]
        await asyncio.sleep(0)
        for task in waiting:
            task.cancel()
        await asyncio.gather(*waiting, return_exceptions=True)
        assert (await loop.get_session("s")).session_id == "s"


async def test_a_failed_turn_is_counted_and_tried_again():
    engine = FakeEngine()
    async with Running(engine) as loop:
        await loop.create_session("s")
        await loop.create_agents("s", people(1))
        stream = await loop.subscribe("s")
        await first(stream, 1)
        engine.fail_next = 2
        await until(lambda: not loop.ready)
        assert loop.alive
        await until(lambda: loop.ready)
        seqs = [b[0].seq for b in await first(stream, 3)]
        assert seqs == list(range(seqs[0], seqs[0] + 3))
        assert (await loop.stats()).failures == 2


async def test_a_loop_that_keeps_failing_ends_and_says_so():
    engine = FakeEngine()
    async with Running(engine) as loop:
        await loop.create_session("s")
        stream = await loop.subscribe("s")
        engine.fail_next = FAILURES
        await loop.create_agents("s", people(1))
        with pytest.raises(Unavailable, match="failed: the engine broke down"):
            await first(stream, 100)
        await until(lambda: not loop.alive)
        assert not loop.ready
        with pytest.raises(Unavailable, match="broke down"):
            await loop.create_session("t")


async def test_before_it_is_warm_the_loop_is_alive_and_not_ready():
    warm = threading.Event()
    loop = MotionLoop(make_world(), warm_up=lambda: warm.wait(5))
    assert not loop.alive
    with pytest.raises(Unavailable, match="has not been started"):
        await loop.create_session("s")
    loop.start()
    assert loop.alive and not loop.ready
    warm.set()
    await until(lambda: loop.ready)
    await loop.stop()
    assert not loop.alive and not loop.ready


async def test_a_failed_warm_up_is_no_ready_loop():
    def fail():
        raise RuntimeError("no memory")

    loop = MotionLoop(make_world(), warm_up=fail)
    loop.start()
    await until(lambda: not loop.alive)
    assert not loop.ready
    with pytest.raises(Unavailable, match="no memory"):
        await loop.create_session("s")


async def test_stop_ends_streams_and_commands():
    async with Running() as loop:
        await loop.create_session("s")
        stream = await loop.subscribe("s")
        await loop.stop()
        assert [b async for b in stream] == []
        with pytest.raises(Unavailable, match="has been stopped"):
            await loop.stats()


async def test_a_full_inbox_refuses():
    gate = threading.Event()
    engine = FakeEngine()
    step = engine.step
    engine.step = lambda *a: (gate.wait(5), step(*a))[1]
    async with Running(engine, inbox=2) as loop:
        await loop.create_session("s")
        await loop.create_agents("s", people(1))
        await asyncio.sleep(0.3)  # the thread is now within the engine
        waiting = [asyncio.ensure_future(loop.get_session("s")) for _ in range(2)]
        await asyncio.sleep(0)
        with pytest.raises(Unavailable, match="2 commands are waiting"):
            await loop.get_session("s")
        gate.set()
        assert [s.session_id for s in await asyncio.gather(*waiting)] == ["s", "s"]


async def test_a_loop_that_slept_moves_its_schedule_and_goes_on():
    gate = threading.Event()
    gate.set()
    engine = FakeEngine()
    step = engine.step
    engine.step = lambda *a: (gate.wait(5), step(*a))[1]
    async with Running(engine) as loop:
        await loop.create_session("s")
        await loop.create_agents("s", people(1))
        stream = await loop.subscribe("s")
        [[before]] = await first(stream, 1)
        gate.clear()
        await until(lambda: not loop.alive)  # no turn within a second
        await asyncio.sleep(0.5)
        gate.set()
        chunks = [c for b in await first(stream, 6) for c in b]
        seqs = [c.seq for c in chunks]
        assert seqs == list(range(before.seq + 1, before.seq + 1 + len(seqs)))
        assert (await loop.stats()).rebased == 1
        gap = np.diff([c.scheduled_at for c in [before, *chunks]])
        assert gap.max() > 1.0 and (gap > 0.19).all(), "once later, and then real time again"
