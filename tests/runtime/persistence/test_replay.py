"""A log played again makes the same motion, bit for bit."""

from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest

from tests.runtime.kept_worlds import assert_same_poses, fake_worlds, shipped_worlds
from tests.world.fakes import FakeEngine, people, taken
from wayfarer.errors import FailedPrecondition
from wayfarer.runtime.persistence.log_format import LogOrigin, decode_log, encode_log
from wayfarer.runtime.persistence.replay import replay
from wayfarer.world.agents.agent import AgentChange, ChunkFlag, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import Part, Patrol, Routine, Stand, Visit, Wander
from wayfarer.world.goals.commands import Append, Path, Stop
from wayfarer.world.goals.steering import Steering
from wayfarer.world.stepping.budget import DegradationLevel

RECORDED = SessionSpec("s", record=True)


def run(world, seconds, plan, levels=lambda now: None, start=0.0):
    """Let time pass in steps of 10 ms; `plan` holds (when, call) pairs in order of time."""
    sent, plan = [], list(plan)
    for tick in range(round(seconds * 100)):
        now = start + tick / 100
        while plan and plan[0][0] <= now - start:
            plan.pop(0)[1](now)
        sent += world.collect(now)
        while (event := world.next_event()) is not None and event <= now:
            world.step(now, levels(now))
            sent += world.collect(now)
    return sent


def replayed(worlds, world):
    """Through the bytes that a client would keep."""
    origin = LogOrigin(worlds.body, worlds.models.stamps, 4)
    data = encode_log(worlds.recordings.copy("s"), origin)
    log = decode_log(data, origin, worlds.settings.limits, worlds.settings.limits.log_entries)
    return list(replay(log, worlds.solo))


def by_agent(chunks):
    found = defaultdict(list)
    for chunk in chunks:
        found[chunk.agent_id].append(chunk)
    return found


def assert_same(publications, sent):
    expected = by_agent(sent)
    found = by_agent(chunk for p in publications for chunk in p.chunks)
    assert found.keys() == expected.keys()
    for name, chunks in expected.items():
        assert [c.seq for c in found[name]] == [c.seq for c in chunks]
        for a, b in zip(found[name], chunks, strict=True):
            assert_same_poses(a, b)
            assert (a.flags, a.candidates) == (b.flags, b.candidates), a.seq
            assert a.scheduled_at == pytest.approx(b.scheduled_at, abs=1e-5)


def busy_plan(world, ids):
    """All commands of agents, some at awkward moments."""
    a, b, c = ids[:3]
    through = Goal((3.0, 3.0, 0.0), stop=False)
    beats = Patrol((through, Goal((1.0, 1.0, 0.0)), Goal((4.0, 0.0, 0.0))), to_and_fro=True)
    routine = Routine((Part(Visit((through,))), Part(Stand(), 1.0), Part(beats, 2.0)), repeat=True)
    return [
        (0.2, lambda now: world.give(ids[-1], routine, now)),
        (0.3, lambda now: world.give(a, Goal((0.0, 9.0, 0.0)), now)),
        (0.31, lambda now: world.give(b, Wander((2.0, 0.0), 4.0), now)),
        (0.5, lambda now: world.give(c, Path((through, Goal((5.0, 1.0, 0.0)))), now)),
        (1.15, lambda now: world.give(a, Goal((0.0, -3.0, 0.0), heading=1.0), now)),
        (1.16, lambda now: world.give(c, Append((Goal((-4.0, 2.0, 0.0)),)), now)),
        (1.17, lambda now: world.give(a, Append((Goal((2.0, 2.0, 0.0)),)), now)),
        (1.18, lambda now: world.give(a, Goal((0.0, -5.0, 0.0)), now)),
        (2.0, lambda now: world.update_agent(a, AgentChange(foot_lock=False))),
        (3.0, lambda now: world.update_agent(a, AgentChange(foot_lock=True, name="Ada"))),
        (3.3, lambda now: world.give(b, Stop(), now)),
        (4.0, lambda now: world.give(b, Append((Goal((1.0, 4.0, 0.0)),)), now)),
        (4.5, lambda now: world.skip(now + 0.7)),
        (5.0, lambda now: world.hold("s", now + 0.5)),
        (6.0, lambda now: world.delete_agent(c)),
    ]


def busy_levels(now):
    """The ladder up and down, idle agents held at times."""
    return DegradationLevel((4, 2, 1, 1)[int(now * 3) % 4], hold_idle=int(now) % 3 == 2)


@pytest.fixture
def recorded():
    worlds = fake_worlds(steering=Steering().with_search(candidates=4))
    world = worlds.live()
    world.create_session(RECORDED, 0.0)
    ids = [agent.agent_id for agent in world.create_agents("s", people(5), 0.0)]
    sent = run(world, 10.0, busy_plan(world, ids), busy_levels)
    return worlds, world, sent


def test_everything_that_was_told_and_tried_is_made_again(recorded):
    worlds, world, sent = recorded
    assert {ChunkFlag.HELD, ChunkFlag.REPLANNED, ChunkFlag.REDUCED} <= {
        flag for chunk in sent for flag in chunk.flags
    }
    publications = replayed(worlds, world)
    assert_same(publications, sent)
    assert [p.position for p in publications] == list(range(1, len(publications) + 1))
    times = [p.scheduled_at for p in publications]
    assert times == sorted(times)
    assert all(len({c.alias for c in p.chunks}) == len(p.chunks) for p in publications)


def test_agents_are_introduced_with_their_first_chunk(recorded):
    worlds, world, _ = recorded
    publications = replayed(worlds, world)
    added = [info for p in publications for info in p.added]
    assert sorted(info.alias for info in added) == [1, 2, 3, 4, 5]
    for published in publications:
        for info in published.added:
            [chunk] = [c for c in published.chunks if c.alias == info.alias]
            assert chunk.seq == 0 and chunk.agent_id == info.agent_id and info.session_id == "s"


def test_a_log_may_begin_in_mid_motion():
    worlds = fake_worlds()
    world = worlds.live()
    world.create_session(SessionSpec("s"), 0.0)
    [a] = world.create_agents("s", people(1), 0.0)
    world.give(a.agent_id, Wander((2.0, 0.0), 4.0), 0.0)
    run(world, 3.03, [])
    record = taken(world)
    other = worlds.live()
    other.members.put_session(replace(record, spec=RECORDED), 500.0)
    sent = run(other, 4.0, [], start=500.0)
    assert sent[0].seq > 5
    assert_same(replayed(worlds, other), sent)


@pytest.mark.slow
def test_twenty_seconds_of_the_shipped_model_come_out_bit_for_bit():
    worlds = shipped_worlds(phases=1)  # stepped in one batch, and played again one by one
    world = worlds.live()
    world.create_session(RECORDED, 0.0)
    specs = people(3, gender="female")
    ids = [agent.agent_id for agent in world.create_agents("s", specs, 0.0)]
    rng = np.random.default_rng(5)
    plan = busy_plan(world, ids)[:-1]
    for when in np.arange(7.0, 20.0, 1.3):
        who, (x, y) = ids[int(rng.integers(3))], rng.uniform(-5, 5, 2)
        plan.append((when, lambda now, who=who, x=x, y=y: world.give(who, Goal((x, y, 0)), now)))
    sent = run(
        world, 20.0, plan, lambda now: DegradationLevel((1, 4, 1, 1, 2, 1, 1)[int(now * 3) % 7])
    )
    assert len(sent) > 3 * 90
    assert_same(replayed(worlds, world), sent)


class Striding(FakeEngine):
    """Another model: it walks twice as fast as requested."""

    name = "striding"
    graphs = ("2" * 64, "3" * 64)

    def step(self, gender, inputs):
        return super().step(gender, replace(inputs, target_speed=2 * inputs.target_speed))


def test_a_change_of_model_is_made_again():
    worlds = fake_worlds()
    worlds.models.add(Striding())
    world = worlds.live()
    world.create_session(RECORDED, 0.0)
    ids = [agent.agent_id for agent in world.create_agents("s", people(3), 0.0)]
    sent = run(
        world,
        6.0,
        [
            (0.3, lambda now: world.give(ids[0], Goal((0.0, 30.0, 0.0)), now)),
            (1.5, lambda now: world.use_model("striding")),
            (1.55, lambda now: world.give(ids[1], Goal((0.0, 30.0, 0.0)), now)),
            (4.0, lambda now: world.use_model("fake")),
        ],
    )
    assert_same(replayed(worlds, world), sent)
    worlds.models.remove("striding")
    with pytest.raises(
        FailedPrecondition, match=r"made with model striding@\w+; loaded here are fake@"
    ):
        replayed(worlds, world)
