"""An error that one agent or session causes: everybody else goes on, and misses nothing.

Every stage of a turn fails here for one agent, or for its session, in the real service.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from tests.service.kept_worlds import fake_worlds, open_journal
from tests.service.running import until
from tests.world.fakes import FakeEngine, people
from tests.world.scenes.grounds import BOX, FIELD
from wayfarer.errors import FailedPrecondition, NotFound, Unavailable
from wayfarer.navigation.scene_spec import Cylinder, SceneSpec
from wayfarer.service.faults import FaultLog
from wayfarer.service.motion_service import MotionService
from wayfarer.service.persistence import capture
from wayfarer.service.persistence.record import Recordings
from wayfarer.service.streams.goal_events import GoalEvents
from wayfarer.service.streams.publications import SlowReader, StreamOptions
from wayfarer.service.streams.publisher import Publisher
from wayfarer.service.streams.root_tracks import RootTracks
from wayfarer.service.streams.subscription import Subscription
from wayfarer.service.thread import FAILURES
from wayfarer.transport.metrics import Metrics
from wayfarer.world import sending
from wayfarer.world.agents.agent import AgentState, ChunkFlag, SessionSpec, Sight
from wayfarer.world.agents.faults import MAX_FAULTS, PAUSE, Stage
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import Wander
from wayfarer.world.behaviours.runner import BehaviourRunner
from wayfarer.world.events import EventKind
from wayfarer.world.goals.steering import Steering
from wayfarer.world.scenes import populate
from wayfarer.world.scenes.guide import SceneGuide
from wayfarer.world.scenes.messages import Crowd, SceneSource
from wayfarer.world.scenes.planner import Planner
from wayfarer.world.scenes.world_scenes import WorldScenes
from wayfarer.world.stepping import load, scheduler
from wayfarer.world.stepping.budget import DegradationLevel
from wayfarer.world.stepping.scheduler import Scheduler
from wayfarer.world.stepping.unstepped import Unstepped

GUILTY, MARK = "bad", 2.5
"""The session with an agent that has this first beta; it is the first of three."""

SOURCE = SceneSource(SceneSpec((FIELD,), (BOX,)))


POST = Cylinder((1.0, 11.0), 0.2, 1.0)


class InjectedError(Exception):
    """What a test injects."""


class Rig:
    """A service whose session `bad` has one agent that a stage fails for, and `good` has none."""

    def __init__(self, tmp_path=None, engine=None, **settings):
        self.metrics = Metrics()
        self.engine = engine or MarkedEngine()
        journal = None if tmp_path is None else open_journal(tmp_path / "state")
        settings = {"steering": Steering(reactions=1)} | settings
        worlds = replace(
            fake_worlds(journal, self.engine, **settings), report=FaultLog(self.metrics)
        )
        self.service = MotionService(worlds, meter=self.metrics)
        self.world = self.service._world
        self.unready = 0

    async def __aenter__(self):
        self.service.start()
        await until(lambda: self.service.ready, 20)
        self.scene = (await self.service.scenes.create_scene(SOURCE)).scene_id
        self.watch = asyncio.create_task(self._watch())
        return self

    async def __aexit__(self, *_):
        self.watch.cancel()
        await self.service.stop()

    async def _watch(self):
        while True:
            self.unready += not (self.service.ready and self.service.alive)
            await asyncio.sleep(0.005)

    async def populate(self, record=False):
        spec = SessionSpec(GUILTY, scene="" if record else self.scene, record=record)
        await self.service.create_session(spec)
        await self.service.create_session(SessionSpec("good"))
        specs = [replace(s, position=(2.0 + 2 * i, 2.0)) for i, s in enumerate(people(3))]
        specs[0] = replace(specs[0], betas=(MARK, *specs[0].betas[1:]), gender="female")
        made = await self.service.create_agents(GUILTY, specs)
        self.guilty, *self.fellows = [agent.agent_id for agent in made]
        self.slot = self.world.registry.agents[self.guilty].slot
        elsewhere = [replace(s, position=(50.0 + 2 * i, 0.0)) for i, s in enumerate(people(2))]
        for agent in await self.service.create_agents("good", elsewhere):
            await self.service.give(agent.agent_id, Goal((50.0, 90.0, 0.0)))
        self.good = Reader(await self.service.subscribe("good", StreamOptions()))
        return self

    async def read(self, **options):
        self.bad = Reader(await self.service.subscribe(GUILTY, StreamOptions(**options)))
        await until(lambda: len(self.bad.seqs) == 3 and len(self.good.seqs) == 2, 20)

    def counted(self, name, **labels):
        return self.metrics.registry.get_sample_value(name, labels) or 0

    def faults(self, stage):
        return self.counted("wayfarer_faults_total", stage=str(stage))


class Reader:
    """Reads a stream beside the test."""

    def __init__(self, subscription):
        self.subscription = subscription
        self.seqs, self.events, self.states = {}, [], {}
        self.flags = 0
        self.error = None
        self.task = asyncio.create_task(self._read(subscription))

    async def _read(self, subscription):
        try:
            async for publication in subscription:
                for chunk in publication.chunks:
                    assert np.isfinite(chunk.translation).all()
                    assert np.isfinite(chunk.rotations).all()
                    self.seqs.setdefault(chunk.agent_id, []).append(chunk.seq)
                    self.states[chunk.agent_id] = chunk.state
                    self.flags |= int(chunk.flags)
                self.events += publication.events
        except Exception as error:
            self.error = error

    def missed_nothing(self):
        assert self.error is None
        assert not self.flags & ChunkFlag.GAP
        for seqs in self.seqs.values():
            assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
        return bool(self.seqs)

    def told(self, stage_words=""):
        return [
            e for e in self.events if e.kind is EventKind.FAULT and stage_words in (e.detail or "")
        ]

    async def more(self, count):
        """Wait for so many more chunks of one agent."""
        before = {name: len(seqs) for name, seqs in self.seqs.items()}
        await until(
            lambda: any(len(s) >= before.get(n, 0) + count for n, s in self.seqs.items()), 20
        )


class MarkedEngine(FakeEngine):
    """Fails for a marked row, if it is told to."""

    fails = False

    def step(self, gender, inputs):
        if self.fails and (inputs.betas[:, 0] == np.float32(MARK)).any():
            raise InjectedError("the engine does not like the row")
        return super().step(gender, inputs)


@dataclass
class Case:
    """How a stage is made to fail, and what that means."""

    stage: Stage
    inject: Callable
    of_agent: bool = True  # else of its session
    options: dict | None = None
    goal: object = Goal((2.0, 10.0, 0.0))
    holds: bool = False  # the agent stands meanwhile


def failing(monkeypatch, owner, name, is_guilty):
    """Let a function fail when `is_guilty(arguments)`."""
    real = getattr(owner, name)

    def wrapped(*args, **kwargs):
        if is_guilty(*args):
            raise InjectedError(f"{name} fails")
        return real(*args, **kwargs)

    monkeypatch.setattr(owner, name, wrapped)


def engine_fails(rig, monkeypatch):
    rig.engine.fails = True


def engine_gives_nan(rig, monkeypatch):
    rig.engine.nan_for_beta = MARK


def way_is_not_found(rig, monkeypatch):
    failing(monkeypatch, Planner, "_look", lambda self, slot, *_: slot == rig.slot)


def way_fails(rig, monkeypatch):
    failing(monkeypatch, SceneGuide, "_led", lambda self, rows, *_: rig.slot in rows)


def steering_fails(rig, monkeypatch):
    seed = rig.world.slots.noise_seed[rig.slot] = np.uint64(666)
    failing(monkeypatch, scheduler, "sets_off", lambda seeds, *_: seed in seeds)


def inputs_fail(rig, monkeypatch):
    failing(monkeypatch, scheduler, "gather", lambda slots, rows, *_: rig.slot in rows)


def rules_fail(rig, monkeypatch):
    failing(monkeypatch, Scheduler, "apply", lambda self, batch, *_: rig.slot in batch.rows)


def rules_give_nan(rig, monkeypatch):
    real = scheduler.shorten

    def shorten(before, gait, start, step, seed):
        step, seed = real(before, gait, start, step, seed)
        mine = np.abs(start[:, 0] - 2.0) < 1.0  # where the guilty one is
        seed.markers[mine] = np.nan
        return step, seed

    monkeypatch.setattr(scheduler, "shorten", shorten)


def feet_fail(rig, monkeypatch):
    failing(monkeypatch, sending, "clean_feet", lambda slots, sent, *_: rig.slot in sent.slots)


def ground_fails(rig, monkeypatch):
    failing(monkeypatch, sending, "ground", lambda s, scenery, sent, *_: rig.slot in sent.slots)


def behaviour_fails(rig, monkeypatch):
    failing(
        monkeypatch, BehaviourRunner, "_update", lambda self, agent: agent.agent_id == rig.guilty
    )


def recording_fails(rig, monkeypatch):
    failing(monkeypatch, Recordings, "sent", lambda self, due: due.session_id == GUILTY)


def schedule_fails(rig, monkeypatch):
    log = rig.service._live._publisher._logs[GUILTY]
    failing(monkeypatch, type(log), "has_holders", lambda self: self is log)


def sights_fail(rig, monkeypatch):
    failing(monkeypatch, Publisher, "sights", lambda self, session_id, _: session_id == GUILTY)


def roots_fail(rig, monkeypatch):
    failing(monkeypatch, RootTracks, "follow", lambda self, chunks: rig.guilty in chunks.agent_id)


def events_fail(rig, monkeypatch):
    failing(monkeypatch, GoalEvents, "_of", lambda self, chunk: chunk.agent_id == rig.guilty)


def crowd_fails(rig, monkeypatch):
    failing(monkeypatch, populate, "drawn_person", lambda crowd, *_: crowd.seed == 666)


def scene_fails(rig, monkeypatch):
    failing(monkeypatch, WorldScenes, "_take_up", lambda *_: True)


NEAR = Goal((2.0, 3.0, 0.0))
CASES = {
    "way not found": Case(Stage.WAY, way_is_not_found),
    "way": Case(Stage.WAY, way_fails, holds=True),
    "steering": Case(Stage.STEERING, steering_fails, holds=True),
    "inputs": Case(Stage.INPUTS, inputs_fail, holds=True),
    "engine": Case(Stage.ENGINE, engine_fails, holds=True),
    "engine gives NaN": Case(Stage.ENGINE, engine_gives_nan, holds=True),
    "rules": Case(Stage.RULES, rules_fail, holds=True),
    "rules give NaN": Case(Stage.RULES, rules_give_nan, holds=True),
    "behaviour": Case(Stage.BEHAVIOUR, behaviour_fails, goal=Wander(None)),
    "feet": Case(Stage.FEET, feet_fail),
    "ground": Case(Stage.GROUND, ground_fails),
    "event": Case(Stage.EVENT, events_fail, goal=NEAR),
    "record": Case(Stage.RECORD, recording_fails, of_agent=False),
    "schedule": Case(
        Stage.SCHEDULE, schedule_fails, of_agent=False, options={"slow_reader": SlowReader.HOLD}
    ),
    "sight": Case(Stage.SIGHT, sights_fail, of_agent=False),
    "roots": Case(Stage.ROOTS, roots_fail, of_agent=False, options={"roots": True}),
    "crowd": Case(Stage.CROWD, crowd_fails, of_agent=False),
    "scene": Case(Stage.SCENE, scene_fails, of_agent=False),
}


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
            await rig.service.scenes.put_obstacle(rig.scene, "post", POST)
        await until(lambda: rig.faults(case.stage), 20)
        await rig.bad.more(8)
        await rig.good.more(2)
        await until(lambda: rig.bad.told(), 5)
        told = rig.bad.told()[0]
        assert told.agent_id == (rig.guilty if case.of_agent else "")
        assert "an error in the server" in told.detail and "Injected" not in told.detail
        if case.of_agent and case.stage not in (Stage.BEHAVIOUR, Stage.EVENT, Stage.FEET):
            assert ("stands where it is" in told.detail) is (case.stage is not Stage.GROUND)
        if case.holds:
            assert rig.bad.states[rig.guilty] is AgentState.STANDING
        assert rig.bad.missed_nothing(), "neither the agent itself nor its fellows"
        assert set(rig.bad.seqs) >= {rig.guilty, *rig.fellows}
        assert rig.good.missed_nothing() and len(rig.good.seqs) == 2
        assert not rig.good.told(), "nobody else hears of it"
        others = {s for s in Stage if s is not case.stage and rig.faults(s)}
        assert not others, "it is counted where it belongs"
        assert rig.unready == 0
        stats = await rig.service.stats()
        assert stats.failures == 0


@pytest.mark.parametrize("stage", [Stage.COASTING, Stage.RESTING, Stage.STANDING, Stage.SENDING])
async def test_stages_that_come_when_time_is_short(stage, monkeypatch):
    """And those that come after another fault, or lose whose chunk it is."""
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
            short = DegradationLevel(1, coasts=True, hold_idle=True)
            monkeypatch.setattr(load.Load, "allow", lambda *_: short)
        await until(lambda: rig.faults(stage), 20)
        before = rig.bad.seqs[rig.guilty][-1]
        await rig.good.more(8)
        fellows = {name: seqs for name, seqs in rig.bad.seqs.items() if name != rig.guilty}
        assert all(s == list(range(s[0], s[0] + len(s))) for s in fellows.values())
        assert len(fellows) == 2 and rig.good.missed_nothing()
        assert rig.bad.told()[0].agent_id == rig.guilty and rig.unready == 0
        if stage in (Stage.STANDING, Stage.SENDING):  # nothing can be made of it any more
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
        rig.engine.fail_next = 9
        await until(lambda: rig.unready, 20)
        await until(lambda: rig.engine.fail_next == 0 and rig.service.ready, 20)
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
    """What came before plays again, bit for bit; what came after does not follow from the log."""
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
    """Nobody else is concerned, and a clip of somebody who stands still would be a lie."""
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
