"""Sessions in which time passes only on request."""

import asyncio
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from tests.runtime.kept_worlds import fake_worlds
from tests.runtime.running import HeldEngine
from tests.world.fakes import FakeEngine, people, taken
from wayfarer.config.limits import Limits
from wayfarer.errors import (
    AlreadyExists,
    FailedPrecondition,
    InvalidArgument,
    NotFound,
    ResourceExhausted,
    Unavailable,
)
from wayfarer.runtime import homes
from wayfarer.runtime.homes import Homes
from wayfarer.runtime.motion_service import MotionService
from wayfarer.runtime.offline import Offline
from wayfarer.runtime.streams.publications import StreamOptions
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import AgentChange, ChunkFlag, SessionInfo, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.events import EventKind

BIG = Limits(sessions=10_000, agents=1_000_000)
LOCKED = SessionSpec("tool", lock_step=True)


async def until_ready(runtime):
    while not runtime.ready:
        await asyncio.sleep(0.005)


@pytest.fixture
async def runtime():
    limits = Limits(agents=12, agents_per_session=8, sessions=3, offline_jobs=2)
    made = MotionService(fake_worlds(limits=limits))
    made.start()
    await until_ready(made)
    yield made
    await made.stop()


async def test_one_batch_for_each_primitive_timed_from_the_start(runtime):
    await runtime.create_session(LOCKED)
    agents = await runtime.create_agents("tool", people(3))
    await asyncio.sleep(0.3)
    assert [a.position for a in await runtime.list_agents("tool")] == [a.position for a in agents]
    published = await runtime.step_session("tool", 4) + await runtime.step_session("tool", 1)
    assert [p.position for p in published] == [1, 2, 3, 4, 5]
    for number, p in enumerate(published):
        assert [(c.alias, c.seq) for c in p.chunks] == [(1, number), (2, number), (3, number)]
        assert {c.scheduled_at for c in p.chunks} == {(number + 1) * STEP_SECONDS}


async def test_goals_count_from_the_next_primitive_and_nothing_is_thrown_away(runtime):
    await runtime.create_session(LOCKED)
    [a] = await runtime.create_agents("tool", people(1))
    flags, events = ChunkFlag.NONE, []
    for number in range(40):
        if number in (3, 5, 6):
            revision = await runtime.give(a.agent_id, Goal((0.0, 1.0 + number, 0.0)))
        [published] = await runtime.step_session("tool", 1)
        [chunk] = published.chunks
        flags |= chunk.flags
        events += published.events
        if number > 6:
            assert chunk.goal_revision == revision == 3
    assert not flags & ChunkFlag.REPLANNED
    assert [e.kind for e in events] == [EventKind.GOAL_REACHED, EventKind.PATH_DONE]
    assert 0 < events[0].at < 40 * STEP_SECONDS


async def test_it_moves_as_agents_do_in_real_time(runtime):
    worlds = fake_worlds()
    live = worlds.live()
    live.create_session(SessionSpec("s"), 0.0)
    ids = [a.agent_id for a in live.create_agents("s", people(3), 0.0)]
    live.give(ids[0], Goal((0.0, 5.0, 0.0)), 0.0)
    expected = {}
    for chunk in live.advance(5.0):
        expected[chunk.alias, chunk.seq] = chunk.translation

    await runtime.create_session(LOCKED)
    agents = await runtime.create_agents("tool", people(3))
    await runtime.give(agents[0].agent_id, Goal((0.0, 5.0, 0.0)))
    published = await runtime.step_session("tool", 20)
    for p in published:
        for chunk in p.chunks:
            np.testing.assert_array_equal(chunk.translation, expected[chunk.alias, chunk.seq])


async def test_agents_come_and_go_between_primitives(runtime):
    await runtime.create_session(LOCKED)
    assert [len(p.chunks) for p in await runtime.step_session("tool", 2)] == [0, 0]
    [a] = await runtime.create_agents("tool", people(1))
    await runtime.step_session("tool", 1)
    [b] = await runtime.create_agents("tool", people(1))
    [p] = await runtime.step_session("tool", 1)
    assert [(c.alias, c.seq) for c in p.chunks] == [(1, 1), (2, 0)]
    changed = await runtime.update_agent(a.agent_id, AgentChange(name="Ada"))
    assert changed.spec.name == (await runtime.get_agent(a.agent_id)).spec.name == "Ada"
    await runtime.delete_agent(a.agent_id)
    with pytest.raises(NotFound):
        await runtime.get_agent(a.agent_id)
    [p] = await runtime.step_session("tool", 1)
    assert [(c.alias, c.seq) for c in p.chunks] == [(2, 1)]
    assert (await runtime.get_session("tool")).agent_ids == (b.agent_id,)
    await runtime.delete_session("tool")
    with pytest.raises(NotFound):
        await runtime.step_session("tool", 1)
    with pytest.raises(NotFound):
        await runtime.get_agent(b.agent_id)
    assert await runtime.list_sessions() == []


async def test_sessions_of_both_kinds_are_as_old_as_they_are(runtime):
    made = [await runtime.create_session(SessionSpec(lock_step=i == 1)) for i in range(3)]
    ages = [session.created_at for session in made]
    assert ages == sorted(ages)
    listed = [session.session_id for session in await runtime.list_sessions()]
    assert listed == [session.session_id for session in made]


async def test_each_kind_of_session_is_for_its_own_calls(runtime):
    await runtime.create_session(LOCKED)
    await runtime.create_session(SessionSpec("live"))
    with pytest.raises(FailedPrecondition, match="StepAgents"):
        await runtime.subscribe("tool", StreamOptions())
    with pytest.raises(FailedPrecondition, match="create it with `lock_step`"):
        await runtime.step_session("live", 1)
    with pytest.raises(NotFound):
        await runtime.step_session("nowhere", 1)
    with pytest.raises(InvalidArgument):
        await runtime.create_session(SessionSpec("a b", lock_step=True))
    assert [s.session_id for s in await runtime.list_sessions()] == ["tool", "live"]


async def test_an_id_is_taken_in_all_worlds(runtime):
    await runtime.create_session(LOCKED)
    with pytest.raises(AlreadyExists):
        await runtime.create_session(SessionSpec("tool"))
    await runtime.create_session(SessionSpec("live"))
    outcomes = await asyncio.gather(
        runtime.create_session(SessionSpec("live", lock_step=True)),
        runtime.create_session(SessionSpec("new", lock_step=True)),
        runtime.create_session(SessionSpec("new")),
        return_exceptions=True,
    )
    assert [isinstance(found, AlreadyExists) for found in outcomes] == [True, False, True]


async def test_limits_hold(runtime):
    for name in ("a", "b", "c"):
        await runtime.create_session(SessionSpec(name, lock_step=True))
    with pytest.raises(ResourceExhausted, match="3 sessions in lock-step"):
        await runtime.create_session(LOCKED)
    await runtime.create_agents("a", people(8))
    with pytest.raises(ResourceExhausted):
        await runtime.create_agents("a", people(1))
    with pytest.raises(ResourceExhausted, match="12 agents in lock-step"):
        await runtime.create_agents("b", people(5))
    await runtime.delete_session("a")
    await runtime.create_agents("b", people(5))


async def test_limits_hold_while_a_session_is_put_in():
    worlds = fake_worlds(limits=Limits(sessions=2, agents=5))
    sessions = lock_steps(worlds)
    with sessions.opening(LOCKED) as home:
        await home.create_session(LOCKED)
    guest = record_of(3)
    with sessions.opening(guest.spec, guest) as home:
        with (
            pytest.raises(ResourceExhausted, match="2 sessions in lock-step"),
            sessions.opening(LOCKED),
        ):
            pass
        with pytest.raises(ResourceExhausted, match="3 of 5 agents in lock-step"):
            await sessions.create_agents("tool", people(3))
        await home.put_session(guest)
    await sessions.create_agents("tool", people(2))
    with pytest.raises(ResourceExhausted, match="5 of 5 agents in lock-step"):
        await sessions.create_agents("tool", people(1))
    await sessions.stop()


async def test_one_that_is_here_is_not_replaced():
    sessions = lock_steps(fake_worlds())
    guest = record_of(1)
    with sessions.opening(guest.spec, guest) as home:
        await home.put_session(guest)
    with (
        pytest.raises(AlreadyExists, match="'guest' exists already"),
        sessions.opening(guest.spec, guest),
    ):
        pass
    assert sessions.of("guest") is home
    await sessions.stop()


async def test_one_that_cannot_be_put_in_leaves_no_room_taken_and_no_thread():
    sessions = lock_steps(fake_worlds(limits=Limits(sessions=1)))
    for _ in range(2):
        with (
            pytest.raises(InvalidArgument),
            sessions.opening(LOCKED) as home,
        ):
            await home.create_session(SessionSpec("a b"))
    assert not sessions._new_sessions and not sessions._new_agents
    home._thread._thread.join(5)
    assert not home._thread._thread.is_alive()
    await sessions.stop()


class NoLive:
    """Stands for the world in real time."""

    async def stop(self):
        pass


def lock_steps(worlds):
    return Homes(NoLive(), worlds, Offline(1), lambda: 0.0)


def record_of(count):
    """A session in lock-step, as received from another server."""
    world = fake_worlds().lock_step()
    world.create_session(SessionSpec("guest", lock_step=True), 0.0)
    world.create_agents("guest", people(count), 0.0)
    return taken(world, "guest")


async def test_sessions_come_from_other_threads_while_others_are_deleted(monkeypatch):
    class Home:
        def __init__(self, world, *_, **__):
            self.world = world

        def start(self):
            pass

        async def delete_session(self, *_):
            pass

    class Thread:
        ended = 0

        def __init__(self, *_):
            pass

        def end(self, *_):
            Thread.ended += 1

    monkeypatch.setattr(homes, "LiveMotion", Home)
    monkeypatch.setattr(homes, "LockStepThread", Thread)
    interval = sys.getswitchinterval()
    worlds = SimpleNamespace(settings=SimpleNamespace(limits=BIG), lock_step=SimpleNamespace)
    sessions = lock_steps(worlds)

    def put(number):
        names = tuple(f"agent-{number}-{i}" for i in range(250))
        with sessions.opening(LOCKED) as home:
            info = SessionInfo(f"s{number}", names, 0.0, None)
            home.world.list_sessions = lambda: [info]

    for number in range(40):
        put(number)
    sys.setswitchinterval(1e-6)
    try:
        putting = asyncio.create_task(asyncio.to_thread(lambda: [*map(put, range(40, 200))]))
        for number in range(40):
            await sessions.delete_session(f"s{number}")
            await asyncio.sleep(0)
        await putting
    finally:
        sys.setswitchinterval(interval)
    assert Thread.ended == 40
    assert sessions._sessions.keys() == {f"s{number}" for number in range(40, 200)}
    assert len(sessions._agents) == 160 * 250


async def test_a_busy_session_keeps_nobody_else_waiting():
    engine = HeldEngine()
    runtime = MotionService(fake_worlds(engine=engine, limits=Limits(offline_jobs=1)))
    runtime.start()
    await until_ready(runtime)
    await runtime.create_session(LOCKED)
    await runtime.create_session(SessionSpec("other", lock_step=True))
    [agent] = await runtime.create_agents("tool", people(1))
    steps = asyncio.create_task(runtime.step_session("tool", 1))
    assert await asyncio.to_thread(engine.is_busy.wait, 5)
    await asyncio.wait_for(runtime.list_agents("other"), 1)
    listed, _ = await asyncio.wait_for(runtime.list_sessions(), 1)
    assert listed.agent_ids == (agent.agent_id,) and not steps.done()
    with pytest.raises(ResourceExhausted, match=r"limits\.offline_jobs"):
        await runtime.step_session("other", 1)
    waiting = asyncio.create_task(runtime.list_agents("tool"))
    await asyncio.sleep(0.05)
    assert not waiting.done()
    engine.let_go.set()
    assert len(await steps) == 1
    assert len(await waiting) == 1
    await runtime.stop()
    with pytest.raises(Unavailable):
        await runtime.list_agents("tool")


async def test_a_session_that_is_being_deleted_does_not_spoil_the_list(runtime):
    await runtime.create_session(SessionSpec("other"))
    for _ in range(30):
        await runtime.create_session(LOCKED)
        listed, _ = await asyncio.gather(runtime.list_sessions(), runtime.delete_session("tool"))
        assert {session.session_id for session in listed} - {"tool"} == {"other"}


async def test_a_change_of_model_is_told_with_the_next_primitive():
    class Other(FakeEngine):
        name, graphs = "other", ("2" * 64, "3" * 64)

    runtime = MotionService(fake_worlds(), open_model=lambda name: Other())
    runtime.start()
    await until_ready(runtime)
    await runtime.create_session(LOCKED)
    agents = await runtime.create_agents("tool", people(2))
    await runtime.load_model("other")
    assert await runtime.use_model("other", move_agents=True) == 2
    first, second = await runtime.step_session("tool", 2)
    assert [e.kind for e in first.events] == [EventKind.MODEL_CHANGED] * 2
    assert [e.agent_id for e in first.events] == [agent.agent_id for agent in agents]
    assert second.events == ()
    assert [a.model for a in await runtime.list_agents("tool")] == ["other"] * 2
    await runtime.unload_model("fake")
    assert [(m.name, m.in_use) for m in await runtime.list_models()] == [("other", True)]
    await runtime.stop()
