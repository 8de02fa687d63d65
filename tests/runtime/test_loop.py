"""The loop with its real thread, for moments; what depends on time is tested in test_world."""

import asyncio
import gc
import math
import threading
import time

import numpy as np
import pytest

from tests.runtime.chunks import KeepingMeter
from tests.runtime.fakes import FakeEngine, make_world, people
from wayfarer.errors import (
    Aborted,
    AlreadyExists,
    InvalidArgument,
    NotFound,
    ResourceExhausted,
    Unavailable,
)
from wayfarer.runtime.agent import (
    AgentChange,
    ChunkFlag,
    EventKind,
    Goal,
    Resume,
    SessionSpec,
    SlowReader,
    StreamWish,
    Wander,
)
from wayfarer.runtime.commands import AppendGoals, ClearGoal, SetGoal, SetPath
from wayfarer.runtime.loop import LoopSettings, MotionLoop, steady_clock
from wayfarer.runtime.motor import FAILURES
from wayfarer.runtime.settings import Limits

GOAL = Goal((0.0, 5.0, 0.0))
ALL = StreamWish()


class Running:
    """`async with Running() as loop`: started, ready, and stopped at the end."""

    def __init__(self, engine=None, meter=None, limits=None, **settings):
        world = make_world(engine, limits=limits or Limits())
        self.loop = MotionLoop(world, settings=LoopSettings(**settings), meter=meter)

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
        await loop.create_session(SessionSpec("s"))
        agents = await loop.create_agents("s", people(4))
        stream = await loop.subscribe("s", ALL)
        assert await loop.give(agents[0].agent_id, SetGoal(GOAL)) == 1
        batches = await first(stream, 12)
        chunks = [c for p in batches for c in p.chunks]
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
        await loop.create_session(SessionSpec("s"))
        [agent] = await loop.create_agents("s", people(1))
        stream = await loop.subscribe("s", ALL)
        for goal in (Goal((math.nan, 0, 0)), Goal((math.inf, 0, 0)), Goal((9_999.0, 0, 0))):
            with pytest.raises(InvalidArgument, match="allowed"):
                await loop.give(agent.agent_id, SetGoal(goal))
        for call in (
            loop.give("nobody", SetGoal(GOAL)),
            loop.give("nobody", ClearGoal()),
            loop.get_session("nowhere"),
            loop.create_agents("nowhere", people(1)),
            loop.list_agents("nowhere"),
            loop.subscribe("nowhere", ALL),
            loop.subscribe("s", StreamWish(("nobody",))),
        ):
            with pytest.raises(NotFound, match="no"):
                await call
        assert [b.chunks[0].seq for b in await first(stream, 3)] == [0, 1, 2]
        assert loop.ready


async def test_a_subscription_may_name_agents():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        agents = await loop.create_agents("s", people(4))
        stream = await loop.subscribe("s", StreamWish((agents[2].agent_id,)))
        batches = await first(stream, 3)
        assert [[c.agent_id for c in b.chunks] for b in batches] == [[agents[2].agent_id]] * 3


async def test_sessions_do_not_see_each_other_and_end_their_streams():
    async with Running() as loop:
        for name in ("a", "b"):
            await loop.create_session(SessionSpec(name))
            await loop.create_agents(name, people(2))
        a, b = await loop.subscribe("a", ALL), await loop.subscribe("b", ALL)
        own = set((await loop.get_session("a")).agent_ids)
        assert {c.agent_id for p in await first(a, 3) for c in p.chunks} <= own
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
        await loop.create_session(SessionSpec("s"))
        stay, *go = await loop.create_agents("s", people(8))
        stream = await loop.subscribe("s", ALL)
        for agent in go:
            await anext(stream)
            await loop.delete_agent(agent.agent_id)
            with pytest.raises(NotFound):
                await loop.get_agent(agent.agent_id)
        while len((await anext(stream)).chunks) > 1:  # what was sent before
            pass
        batches = await first(stream, 3)
        assert {c.agent_id for b in batches for c in b.chunks} == {stay.agent_id}
        assert [a.agent_id for a in await loop.list_agents("s")] == [stay.agent_id]


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


async def test_a_cancelled_caller_does_no_harm():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        waiting = [asyncio.ensure_future(loop.get_session("s")) for _ in range(20)]
        await asyncio.sleep(0)
        for task in waiting:
            task.cancel()
        await asyncio.gather(*waiting, return_exceptions=True)
        assert (await loop.get_session("s")).session_id == "s"


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


async def test_before_it_is_warm_the_loop_is_alive_and_not_ready():
    warm = threading.Event()
    loop = MotionLoop(make_world(), warm_up=lambda: warm.wait(5))
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

    loop = MotionLoop(make_world(), warm_up=fail)
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
    """Keep the motion thread busy; returns what lets it go."""
    is_busy, let_go = threading.Event(), threading.Event()
    held = asyncio.create_task(loop.ask(lambda *_: (is_busy.set(), let_go.wait(30))))
    await until(is_busy.is_set)
    return held, let_go


async def test_who_has_no_room_is_told_so_whatever_the_motion_thread_is_at():
    async with Running(limits=Limits(agents=4)) as loop:
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


class HeldEngine(FakeEngine):
    """Whose calls last until they are let go."""

    def __init__(self) -> None:
        super().__init__()
        self.let_go, self.is_busy = threading.Event(), threading.Event()

    def step(self, gender, inputs):
        self.is_busy.set()
        self.let_go.wait(30)
        return super().step(gender, inputs)


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
                revision = await loop.give(walker.agent_id, SetGoal(Goal((0.0, 3.0, 0.0))))
        finally:
            engine.let_go.set()
        chunks = [c for b in await first(stream, 6) for c in b.chunks]
    by_agent = {a: [c for c in chunks if c.agent_id == a] for a in {c.agent_id for c in chunks}}
    assert set(by_agent) == {walker.agent_id, newcomer.agent_id}
    assert {c.goal_revision for c in by_agent[walker.agent_id]} == {revision}
    for own in by_agent.values():
        assert [c.seq for c in own] == list(range(len(own)))


async def test_a_full_inbox_refuses():
    async with Running(inbox=2) as loop:
        await loop.create_session(SessionSpec("s"))
        held, let_go = await occupied(loop)
        waiting = [asyncio.ensure_future(loop.get_session("s")) for _ in range(2)]
        await asyncio.sleep(0)
        with pytest.raises(Unavailable, match="2 commands are waiting"):
            await loop.get_session("s")
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
        assert (await loop.stats()).rebased == 1
        gap = np.diff([c.scheduled_at for c in [before, *chunks]])
        assert gap.max() > 1.0 and (gap > 0.19).all(), "once later, and then real time again"


async def test_every_change_of_goals_has_a_revision_and_stale_ones_are_refused():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        [agent] = await loop.create_agents("s", people(1))
        orders = (
            SetGoal(GOAL),
            AppendGoals((GOAL,)),
            SetPath((GOAL, GOAL)),
            Wander((0.0, 0.0), 3.0),
            ClearGoal(),
        )
        for present, order in enumerate(orders):
            with pytest.raises(Aborted, match=f"revision {present}"):
                await loop.give(agent.agent_id, order, expected=present + 7)
            assert await loop.give(agent.agent_id, order, expected=present) == present + 1


async def test_sessions_are_listed_and_agents_changed():
    async with Running() as loop:
        for name in "ts":
            await loop.create_session(SessionSpec(name))
        assert [s.session_id for s in await loop.list_sessions()] == ["t", "s"]
        [agent] = await loop.create_agents("s", people(1))
        changed = await loop.update_agent(agent.agent_id, AgentChange(name="Ada"))
        assert changed.spec.name == "Ada" == (await loop.get_agent(agent.agent_id)).spec.name


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
        again = await loop.subscribe("s", StreamWish(resume=resume))
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
        again = await loop.subscribe("s", StreamWish(resume=Resume(stream.epoch, 0)))
        assert not again.resumed
        [told] = await first(again, 1)
        assert [e.kind for e in told.events] == [EventKind.GAP]
        with pytest.raises(InvalidArgument, match="position is 5; allowed: 0 to 0"):
            await loop.subscribe("s", StreamWish(resume=Resume(again.epoch, 5)))


async def test_goals_reached_and_paths_done_are_told():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        [agent] = await loop.create_agents("s", people(1))
        stream = await loop.subscribe("s", ALL)
        path = (Goal((0.0, 0.5, 0.0), stop=False, speed=2.0), Goal((0.0, 1.0, 0.0), speed=2.0))
        await loop.give(agent.agent_id, SetPath(path))
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
        holder = await loop.subscribe("s", StreamWish(slow_reader=SlowReader.HOLD))
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


async def test_a_session_that_was_taken_out_goes_on_where_it_stood():
    async with Running() as loop:
        await loop.create_session(SessionSpec("s"))
        [agent] = await loop.create_agents("s", people(1))
        stream = await loop.subscribe("s", ALL)
        path = (Goal((0.0, 0.6, 0.0), speed=2.0),)
        await loop.give(agent.agent_id, SetPath(path))
        got = []
        while not any(EventKind.GOAL_REACHED in [e.kind for e in p.events] for p in got):
            got += await first(stream, 1)
        record = await loop.ask(lambda world, _: world.take_session("s"))
        await loop.delete_session("s")
        assert (await loop.put_session(record)).agent_ids == (agent.agent_id,)
        again = await loop.subscribe("s", ALL)
        more = await first(again, 5)
        assert again.epoch != stream.epoch
        assert more[0].chunks[0].seq == record.agents[0].seq
        kinds = [e.kind for p in more for e in p.events]
        assert kinds == [EventKind.PATH_DONE], "reached there, and stood at here"
        with pytest.raises(AlreadyExists):
            await loop.put_session(record)


async def test_the_meter_is_told():
    meter = KeepingMeter()
    async with Running(meter=meter, limits=Limits(agents=2, sessions=1)) as loop:
        await loop.create_session(SessionSpec("s"))
        agent, _ = await loop.create_agents("s", people(2))
        stream = await loop.subscribe("s", ALL)
        await first(stream, 2)
        await loop.give(agent.agent_id, SetGoal(GOAL))
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
        np.testing.assert_allclose(np.diff([c.scheduled_at for c in chunks]), 0.2, atol=1e-6)
        stats = await loop.stats()
        assert stats.rebased == 0 and loop.alive


def test_the_clock_tells_unix_time_and_never_jumps(monkeypatch):
    clock, wall = steady_clock(), time.time
    assert clock() == pytest.approx(wall(), abs=1.0)
    monkeypatch.setattr(time, "time", lambda: 0.0)
    before = clock()
    assert before <= clock() < before + 60.0
