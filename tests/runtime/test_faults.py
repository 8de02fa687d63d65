"""An error that one agent or session causes: all others continue, and miss nothing.

Every stage of a turn fails here for one agent, or for its session, in the real service.
"""

from dataclasses import replace

import pytest

from tests.runtime.fault_rig import GUILTY, MARK, POST, InjectedError, Reader, Rig
from tests.runtime.injected_faults import CASES, failing
from tests.runtime.kept_worlds import fake_worlds, open_journal
from tests.runtime.running import until
from tests.world.fakes import people
from wayfarer.errors import FailedPrecondition, NotFound, Unavailable
from wayfarer.runtime.motion_service import MotionService
from wayfarer.runtime.persistence import capture
from wayfarer.runtime.streams.publications import StreamOptions
from wayfarer.runtime.streams.publisher import Publisher
from wayfarer.runtime.streams.subscription import Subscription
from wayfarer.runtime.thread import FAILURES
from wayfarer.world import sending
from wayfarer.world.agents.agent import AgentState, SessionSpec, Sight
from wayfarer.world.agents.faults import MAX_FAULTS, PAUSE, Stage
from wayfarer.world.agents.goal import Goal
from wayfarer.world.events import EventKind
from wayfarer.world.scenes.messages import Crowd
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.stepping import load
from wayfarer.world.stepping.budget import DegradationLevel
from wayfarer.world.stepping.unstepped import Unstepped


@pytest.mark.parametrize("name", CASES)
async def test_a_stage_that_fails_for_one_concerns_only_that_one(name, monkeypatch):
    case = CASES[name]
    async with Rig() as rig:
        await rig.populate()
        await rig.read(**(case.options or {}))
        await rig.bad.more(2)
        case.inject(rig, monkeypatch)
        await rig.service.give(rig.guilty, case.goal)
        for number, fellow in enumerate(rig.fellows):
            await rig.service.give(fellow, Goal((4.0 + 2 * number, 10.0, 0.0)))
        if case.stage is Stage.CROWD:
            await rig.service.scenes.populate(GUILTY, Crowd(2, seed=666))
        if case.stage is Stage.SCENE:
            await rig.service.scenes.change(SceneRegistry.put, rig.scene, "post", POST)
        await until(lambda: rig.faults(case.stage), 20)
        await rig.bad.more(8)
        await rig.good.more(2)
        await until(lambda: rig.bad.told(), 5)
        told = rig.bad.told()[0]
        assert told.agent_id == (rig.guilty if case.of_agent else "")
        assert "an error in the server" in told.detail and "Injected" not in told.detail
        if case.of_agent and case.stage not in (Stage.BEHAVIOUR, Stage.EVENT):
            assert ("stands where it is" in told.detail) is (case.stage is not Stage.GROUND)
        if case.holds:
            assert rig.bad.states[rig.guilty] is AgentState.STANDING
        assert rig.bad.missed_nothing(), "neither the agent itself nor its fellows"
        assert set(rig.bad.seqs) >= {rig.guilty, *rig.fellows}
        assert rig.good.missed_nothing() and len(rig.good.seqs) == 2
        assert not rig.good.told(), "no other reader hears of it"
        others = {s for s in Stage if s is not case.stage and rig.faults(s)}
        assert not others, "it is counted for its session"
        assert rig.unready == 0
        stats = await rig.service.stats()
        assert stats.failures == 0
        assert rig.counted("wayfarer_goal_latency_seconds_count") > 0


@pytest.mark.parametrize("stage", [Stage.COASTING, Stage.RESTING, Stage.STANDING, Stage.SENDING])
async def test_stages_that_come_when_time_is_short(stage, monkeypatch):
    """Also errors after another fault, or that lose the chunk's owner."""
    async with Rig() as rig:
        await rig.populate()
        await rig.read()
        await rig.bad.more(1)
        if stage is Stage.COASTING:
            rig.world.slots.sight[rig.slot] = Sight.ROOT
            monkeypatch.setattr(Publisher, "sights", lambda *_: Sight.ROOT)
            failing(monkeypatch, Unstepped, "_coast", lambda self, rows: rig.slot in rows)
        if stage is Stage.RESTING:
            failing(monkeypatch, Unstepped, "_rest", lambda self, rows: rig.slot in rows)
        if stage is Stage.STANDING:
            rig.engine.fails = True
            failing(monkeypatch, Unstepped, "_stand", lambda self, rows: rig.slot in rows)
        if stage is Stage.SENDING:
            failing(monkeypatch, sending, "due_by_session", lambda sent, *_: rig.slot in sent.slots)
        if stage in (Stage.COASTING, Stage.RESTING):
            short = DegradationLevel(1, by_sight=True, hold_idle=True)
            monkeypatch.setattr(load.Load, "allow", lambda *_: short)
        await until(lambda: rig.faults(stage), 20)
        before = rig.bad.seqs[rig.guilty][-1]
        await rig.good.more(8)
        fellows = {name: seqs for name, seqs in rig.bad.seqs.items() if name != rig.guilty}
        assert all(s == list(range(s[0], s[0] + len(s))) for s in fellows.values())
        assert len(fellows) == 2 and rig.good.missed_nothing()
        assert rig.bad.told()[0].agent_id == rig.guilty and rig.unready == 0
        if stage in (Stage.STANDING, Stage.SENDING):  # it cannot be used any more
            assert rig.bad.seqs[rig.guilty][-1] <= before + 2
            assert any("delete it" in event.detail for event in rig.bad.told())
            await rig.service.delete_agent(rig.guilty)
        assert (await rig.service.stats()).failures == 0


async def test_an_agent_is_tried_again_and_goes_on():
    async with Rig() as rig:
        await rig.populate()
        await rig.read()
        await rig.service.give(rig.guilty, Goal((2.0, 10.0, 0.0)))
        rig.engine.fails = True
        await until(lambda: rig.bad.told("in the motion model"), 20)
        [told] = rig.bad.told()
        assert told.detail.endswith(f"and is tried again in {PAUSE * 0.2:g} s")
        await rig.bad.more(PAUSE // 2)
        rig.engine.fails = False
        await rig.bad.more(3 * PAUSE)
        assert (await rig.service.get_agent(rig.guilty)).position[1] > 2.3, "it walks"
        assert rig.faults(Stage.ENGINE) == 1 and rig.bad.missed_nothing()


async def test_an_agent_that_keeps_failing_is_left_until_it_is_given_something_else(monkeypatch):
    monkeypatch.setattr("wayfarer.world.agents.faults.PAUSE", 0)
    async with Rig() as rig:
        await rig.populate()
        await rig.read()
        rig.engine.fails = True
        await until(lambda: rig.faults(Stage.ENGINE) >= MAX_FAULTS, 20)
        await rig.bad.more(6)
        assert rig.faults(Stage.ENGINE) == MAX_FAULTS and rig.bad.missed_nothing()
        assert rig.bad.told()[-1].detail.endswith(
            "it stands where it is until it is given another goal"
        )
        rig.engine.fails = False
        await rig.service.give(rig.guilty, Goal((2.0, 10.0, 0.0)))
        await rig.bad.more(8)
        assert (await rig.service.get_agent(rig.guilty)).position[1] > 2.3


async def test_an_engine_that_fails_once_costs_nobody_anything():
    async with Rig() as rig:
        await rig.populate()
        await rig.read()
        await rig.bad.more(1)
        rig.engine.fail_next = 1
        await until(lambda: rig.faults(Stage.ENGINE), 20)
        await rig.good.more(4)
        assert rig.bad.missed_nothing() and rig.good.missed_nothing()
        assert not rig.bad.told() and rig.unready == 0


async def test_an_engine_that_fails_for_all_is_nobodys_fault():
    async with Rig() as rig:
        await rig.populate()
        await rig.read()
        await rig.bad.more(1)
        rig.engine.is_down = True
        await until(lambda: rig.unready, 20)
        await rig.service._live.ask(lambda *_: setattr(rig.engine, "is_down", False))
        await until(lambda: rig.service.ready, 20)
        await rig.good.more(4)
        assert rig.bad.missed_nothing() and rig.good.missed_nothing()
        assert not rig.bad.told() and not rig.good.told()
        assert 0 < (await rig.service.stats()).failures < FAILURES


async def test_a_session_that_cannot_be_published_is_set_aside(monkeypatch, tmp_path):
    async with Rig(tmp_path) as rig:
        await rig.populate()
        await rig.read()
        await rig.bad.more(2)
        log = rig.service._live._publisher._logs[GUILTY]
        failing(monkeypatch, type(log), "add", lambda self, *_: self is log)
        await until(lambda: rig.bad.error, 20)
        assert isinstance(rig.bad.error, FailedPrecondition) and "set aside" in str(rig.bad.error)
        with pytest.raises(NotFound):
            await rig.service.get_session(GUILTY)
        await rig.good.more(4)
        assert rig.good.missed_nothing() and rig.unready == 0
        assert rig.counted("wayfarer_set_aside_total", why="turn") == 1
    [folder] = (tmp_path / "state" / "set-aside").iterdir()
    monkeypatch.undo()
    kept = MotionService(fake_worlds(open_journal(folder)))
    kept.start()
    await until(lambda: kept.ready)
    [session] = await kept.list_sessions()
    assert session.session_id == GUILTY and len(session.agent_ids) == 3, "a server starts on it"
    await kept.stop()
    left = open_journal(tmp_path / "state")
    assert [record.session_id for record in left.restore(rig.world.settings.limits)] == ["good"]
    left.stop()


async def test_a_reader_that_fails_ends_alone(monkeypatch):
    async with Rig() as rig:
        await rig.populate()
        await rig.read()
        beside = Reader(await rig.service.subscribe(GUILTY, StreamOptions()))
        await rig.bad.more(2)
        subscription = rig.bad.subscription
        failing(monkeypatch, Subscription, "put", lambda self, *_: self is subscription)
        await until(lambda: rig.bad.error, 20)
        assert isinstance(rig.bad.error, Unavailable) and "resume" in str(rig.bad.error)
        await beside.more(4)
        assert rig.good.missed_nothing() and beside.missed_nothing()
        assert rig.unready == 0 and rig.faults(Stage.DELIVERY) == 1


async def test_the_log_of_a_recorded_session_ends_where_its_agent_fails():
    """Earlier motion plays again, bit for bit; later motion does not follow from the log."""
    async with Rig() as rig:
        await rig.populate(record=True)
        await rig.read()
        await rig.service.give(rig.guilty, Goal((2.0, 10.0, 0.0)))
        await rig.bad.more(4)
        rig.engine.fails = True
        await until(lambda: rig.bad.told(), 20)
        await rig.bad.more(4)
        last = rig.bad.seqs[rig.guilty][-1]
        rig.engine.fails = False
        log = await rig.service.export_log(GUILTY)
        played = {}
        async for publication in rig.service.replay(log):
            for chunk in publication.chunks:
                played.setdefault(chunk.agent_id, []).append(chunk.seq)
        assert 3 <= played[rig.guilty][-1] < last
        assert all(played[name][-1] >= last - 1 for name in rig.fellows)


async def test_the_journal_of_one_agent_fails(monkeypatch, tmp_path):
    async with Rig(tmp_path) as rig:
        await rig.populate()
        await rig.read()
        failing(
            monkeypatch, capture, "capture_agents",
            lambda world, agents: any(agent.agent_id == rig.guilty for agent in agents),
        )  # fmt: skip
        await until(lambda: rig.faults(Stage.RECORD), 20)
        await rig.good.more(6)
        assert rig.bad.told()[0].agent_id == rig.guilty
        assert rig.good.missed_nothing() and rig.bad.missed_nothing() and rig.unready == 0
    monkeypatch.undo()
    left = open_journal(tmp_path / "state")
    records = {r.session_id: r for r in left.restore(rig.world.settings.limits)}
    left.stop()
    assert len(records["good"].agents) == 2
    assert records["good"].agents[0].motion.seed.translation[0, -1, 1] > 0.3, "where they came to"


async def test_in_lock_step_the_others_are_stepped_and_the_caller_hears_of_it():
    """Whether the first batch of a primitive has sound agents or none."""
    async with Rig() as rig:
        await rig.service.create_session(SessionSpec("tool", lock_step=True))
        specs = [replace(one, position=(2.0 * n, 0.0)) for n, one in enumerate(people(4))]
        for number in (0, 2):  # all of one gender
            specs[number] = replace(specs[number], betas=(MARK, *specs[number].betas[1:]))
        made = [agent.agent_id for agent in await rig.service.create_agents("tool", specs)]
        for agent in made:
            await rig.service.give(agent, Goal((0.0, 30.0, 0.0)))
        rig.engine.fails = True
        published = await rig.service.step_session("tool", 5)
        for publication in published:
            assert sorted(publication.chunks.agent_id) == sorted(made)
        told = [event for one in published for event in one.events]
        assert {event.agent_id for event in told} == {made[0], made[2]}
        assert {event.kind for event in told} == {EventKind.FAULT}
        places = {name: (await rig.service.get_agent(name)).position[1] for name in made}
        assert places[made[1]] > 0.3 and places[made[0]] < 0.1


async def test_a_clip_that_fails_is_an_error():
    """No other agent is concerned, and a clip of a motionless person would be wrong."""
    async with Rig() as rig:
        rig.engine.fails = True
        spec = replace(people(1)[0], betas=(MARK, *people(1)[0].betas[1:]))
        with pytest.raises(InjectedError):
            async for _ in rig.service.generate_clip(spec, [Goal((0.0, 3.0, 0.0))], 2.0, False):
                pass
        assert rig.unready == 0 and not rig.faults(Stage.ENGINE)


def test_all_stages_are_tried_here():
    """`RESTORE` is in persistence/test_set_aside.py."""
    tried = {case.stage for case in CASES.values()}
    tried |= {Stage.COASTING, Stage.RESTING, Stage.STANDING, Stage.SENDING}
    tried |= {Stage.PUBLICATION, Stage.DELIVERY}
    assert set(Stage) - tried == {Stage.RESTORE}
