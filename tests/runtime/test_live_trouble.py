"""The loop when something fails, is slow, full, or at its end."""

import asyncio
import threading
import time

import numpy as np
import pytest

from tests.runtime import running
from tests.runtime.running import ALL, HeldEngine, Loop, Running, first, give, until, world_of
from tests.world.fakes import FakeEngine, make_world, people
from wayfarer.errors import ResourceExhausted, Unavailable
from wayfarer.runtime.inbox import Inbox
from wayfarer.runtime.thread import FAILURES
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.goal import Goal


async def test_a_cancelled_caller_does_no_harm():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        waiting = [asyncio.ensure_future(world_of(loop, "get_session", "s")) for _ in range(20)]
        await asyncio.sleep(0)
        for task in waiting:
            task.cancel()
        await asyncio.gather(*waiting, return_exceptions=True)
        assert (await world_of(loop, "get_session", "s")).session_id == "s"


async def test_a_failed_turn_is_counted_and_tried_again():
    engine = FakeEngine()
    async with Running(engine) as loop:
        await loop.create_session(SessionSpec("s"))
        await loop.create_agents("s", people(1))
        stream = await loop.subscribe("s", ALL)
        await first(stream, 1)
        engine.fail_next = 2
        await until(lambda: not loop.ready)
        assert loop.alive
        await until(lambda: loop.ready)
        seqs = [b.chunks[0].seq for b in await first(stream, 3)]
        assert seqs == list(range(seqs[0], seqs[0] + 3))
        assert (await loop.stats()).failures == 2


async def test_a_loop_that_keeps_failing_ends_and_says_so():
    engine = FakeEngine()
    async with Running(engine) as loop:
        await loop.create_session(SessionSpec("s"))
        stream = await loop.subscribe("s", ALL)
        engine.fail_next = FAILURES
        await loop.create_agents("s", people(1))
        with pytest.raises(Unavailable, match="failed: the engine broke down"):
            await first(stream, 100)
        await until(lambda: not loop.alive)
        assert not loop.ready
        with pytest.raises(Unavailable, match="broke down"):
            await loop.create_session(SessionSpec("t"))


async def test_a_loop_that_may_not_step_is_alive():
    engine, now, may_step = HeldEngine(), 1000.0, True
    loop = Loop(make_world(engine), clock=lambda: now, may_step=lambda: may_step)
    loop.start()
    await until(lambda: loop.ready)
    await loop.create_session(SessionSpec("s"))
    await loop.create_agents("s", people(1))
    while not engine.is_busy.is_set():
        now += 0.1
        await asyncio.sleep(0.01)
    may_step = False
    engine.let_go.set()
    await until(lambda: loop._thread._pipeline.has_completed)
    now += 5.0
    await until(lambda: loop.alive)
    await loop.stop()


async def test_before_it_is_warm_the_loop_is_alive_and_not_ready():
    warm = threading.Event()
    loop = Loop(make_world(), warm_up=lambda: warm.wait(5))
    assert not loop.alive
    with pytest.raises(Unavailable, match="has not been started"):
        await loop.create_session(SessionSpec("s"))
    loop.start()
    assert loop.alive and not loop.ready
    warm.set()
    await until(lambda: loop.ready)
    await loop.stop()
    assert not loop.alive and not loop.ready


async def test_a_failed_warm_up_is_no_ready_loop():
    def fail():
        raise RuntimeError("no memory")

    loop = Loop(make_world(), warm_up=fail)
    loop.start()
    await until(lambda: not loop.alive)
    assert not loop.ready
    with pytest.raises(Unavailable, match="no memory"):
        await loop.create_session(SessionSpec("s"))


async def test_stop_ends_streams_and_commands():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        stream = await loop.subscribe("s", ALL)
        await loop.stop()
        assert [b async for b in stream] == []
        with pytest.raises(Unavailable, match="has been stopped"):
            await loop.stats()


async def occupied(loop):
    """Keep the motion thread busy; returns the function that releases it."""
    is_busy, let_go = threading.Event(), threading.Event()
    held = asyncio.create_task(loop.ask(lambda *_: (is_busy.set(), let_go.wait(30))))
    await until(is_busy.is_set)
    return held, let_go


async def test_who_has_no_room_is_told_so_whatever_the_motion_thread_is_at():
    async with Running(agents=4) as loop:
        await loop.create_session(SessionSpec("s"))
        await loop.create_agents("s", people(1))
        held, let_go = await occupied(loop)
        try:
            coming = asyncio.create_task(loop.create_agents("s", people(2)))
            await asyncio.sleep(0.05)
            async with asyncio.timeout(10):
                with pytest.raises(ResourceExhausted, match="3 of 4 agents exist"):
                    await loop.create_agents("s", people(2))
            assert not coming.done()
        finally:
            let_go.set()
        await held
        assert len(await coming) == 2


async def test_commands_are_answered_while_the_engine_is_at_work():
    engine = HeldEngine()
    async with Running(engine) as loop:
        await loop.create_session(SessionSpec("s"))
        leaver, walker = await loop.create_agents("s", people(2))
        stream = await loop.subscribe("s", ALL)
        await until(engine.is_busy.is_set)
        try:
            async with asyncio.timeout(10):
                await loop.delete_agent(leaver.agent_id)
                [newcomer] = await loop.create_agents("s", people(1))  # into the slot that is free
                revision = await give(loop, walker.agent_id, Goal((0.0, 3.0, 0.0)))
        finally:
            engine.let_go.set()
        chunks = [c for b in await first(stream, 6) for c in b.chunks]
    by_agent = {a: [c for c in chunks if c.agent_id == a] for a in {c.agent_id for c in chunks}}
    assert set(by_agent) == {walker.agent_id, newcomer.agent_id}
    assert {c.goal_revision for c in by_agent[walker.agent_id]} == {revision}
    for own in by_agent.values():
        assert [c.seq for c in own] == list(range(len(own)))


async def test_a_full_inbox_refuses(monkeypatch):
    monkeypatch.setattr(running, "INBOX", 2)
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        held, let_go = await occupied(loop)
        waiting = [asyncio.ensure_future(world_of(loop, "get_session", "s")) for _ in range(2)]
        await asyncio.sleep(0)
        with pytest.raises(Unavailable, match="2 commands are waiting"):
            await world_of(loop, "get_session", "s")
        let_go.set()
        await held
        assert [s.session_id for s in await asyncio.gather(*waiting)] == ["s", "s"]


async def test_a_loop_that_slept_moves_its_schedule_and_goes_on():
    gate = threading.Event()
    gate.set()
    engine = FakeEngine()
    step = engine.step
    engine.step = lambda *a: (gate.wait(5), step(*a))[1]
    async with Running(engine) as loop:
        await loop.create_session(SessionSpec("s"))
        await loop.create_agents("s", people(1))
        stream = await loop.subscribe("s", ALL)
        [before] = (await first(stream, 1))[0].chunks
        gate.clear()
        await until(lambda: not loop.alive)  # no turn within a second
        await asyncio.sleep(0.5)
        gate.set()
        chunks = [c for b in await first(stream, 6) for c in b.chunks]
        seqs = [c.seq for c in chunks]
        assert seqs == list(range(before.seq + 1, before.seq + 1 + len(seqs)))
        assert (await loop.stats()).skipped_steps >= 5
        gap = np.diff([c.scheduled_at for c in [before, *chunks]])
        assert gap.max() > 1.0 and (gap > 0.19).all(), "once later, and then real time again"


async def test_commands_are_taken_from_the_first_moment_of_ready(monkeypatch):
    slow = Inbox.open
    monkeypatch.setattr(Inbox, "open", lambda inbox: (time.sleep(0.2), slow(inbox)))
    async with Running() as loop:  # asks at the first moment of `ready`
        assert (await loop.stats()).sessions == 0
