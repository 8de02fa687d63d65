"""Held agents: idle ones when time is short, and agents of a slow reader."""

import numpy as np
import pytest

from tests.world.fakes import GOAL, FakeEngine, make_world, people, populated
from wayfarer.errors import NotFound
from wayfarer.spec import NEW_FRAMES, STEP_SECONDS
from wayfarer.world.agents.agent import AgentState, ChunkFlag, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.views import agents_by_state
from wayfarer.world.behaviours import Wander
from wayfarer.world.goals.commands import Append, Path
from wayfarer.world.goals.steering import Steering
from wayfarer.world.stepping.budget import BudgetRules, DegradationLevel

HOLD = DegradationLevel(1, hold_idle=True)


def run(world, until, level=None):
    """Like `World.advance`, on one level of the ladder."""
    chunks = []
    while (event := world.next_event()) <= until:
        chunks += world.collect(event)
        world.step(event, level)
    return chunks


def own(chunks, alias):
    return [c for c in chunks if c.alias == alias]


def is_seamless(chunks, most=0.05):
    """Whether hips move at most this far per frame, and every number occurs once."""
    frames = np.concatenate([c.translation for c in chunks])
    seqs = [c.seq for c in chunks]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
    assert [c.first_frame for c in chunks] == [NEW_FRAMES * seq for seq in seqs]
    return np.linalg.norm(np.diff(frames, axis=0), axis=-1).max() < most


def test_who_has_nothing_to_do_is_held_without_an_engine_call():
    engine = FakeEngine()
    world, _ = populated(engine=engine)
    before = run(world, 1.0)
    engine.calls.clear()
    held = run(world, 3.0, HOLD)
    assert engine.calls == []
    after_first = held[1:]  # the first was planned before
    assert len(after_first) == 9 and world.scheduler.unstepped.held_steps == 10
    for chunk in after_first:
        assert chunk.flags & ChunkFlag.HELD and chunk.candidates == 0
        assert chunk.state is AgentState.STANDING
        assert np.ptp(chunk.translation, axis=0).max() == 0
        assert np.ptp(chunk.rotations[:, 0], axis=0).max() == 0
    after = run(world, 4.0)
    assert not any(c.flags & ChunkFlag.HELD for c in [*before, *after[1:]])
    assert is_seamless([*before, *held, *after], most=0.001)
    assert engine.calls


def test_without_foot_lock_both_feet_of_the_held_are_on_the_ground():
    world = make_world()
    world.create_session(SessionSpec("s"), 0.0)
    world.create_agents("s", people(1, foot_lock=False), 0.0)
    run(world, 1.0)
    assert all(c.contacts.all() for c in run(world, 2.0, HOLD))


@pytest.mark.parametrize(
    "order",
    [
        lambda world, agent: world.give(agent, GOAL, 1.0),
        lambda world, agent: world.give(agent, Goal((0.0, 0.0, 0.0), heading=1.5), 1.0),
        lambda world, agent: world.give(agent, Wander((0.0, 0.0), 3.0), 1.0),
        lambda world, agent: world.give(agent, Append((GOAL,)), 1.0),
    ],
    ids=["walk", "turn", "wander", "append"],
)
def test_who_has_something_to_do_is_stepped_and_comes_back_at_once(order):
    world, [agent] = populated()
    before = run(world, 1.0, HOLD)
    order(world, agent)
    after = run(world, 2.0, HOLD)
    first = next(c for c in after if c.goal_revision == 1)
    assert first.scheduled_at <= 1.25, "within one primitive"
    assert first.state is not AgentState.STANDING
    assert not any(c.flags & ChunkFlag.HELD for c in after[after.index(first) :])
    assert is_seamless([*before, *after])


def test_who_has_arrived_is_held_and_stays_where_it_is():
    world, [agent] = populated()
    world.give(agent, GOAL, 0.0)
    chunks = run(world, 12.0, HOLD)
    flags = [bool(c.flags & ChunkFlag.HELD) for c in chunks]
    first = flags.index(True)
    assert all(flags[first:]) and first > 10
    assert chunks[first - 1].state is AgentState.STANDING, "it comes to a stand first"
    assert sum(bool(c.flags & ChunkFlag.ARRIVED) for c in chunks) == 1
    assert is_seamless(chunks)
    world.give(agent, Append((Goal((0.0, 8.0, 0.0)),)), 12.0)
    assert any(c.flags & ChunkFlag.ARRIVED for c in run(world, 20.0, HOLD))


def test_who_dwells_on_its_path_goes_on_in_time():
    def arrival(level):
        world, [agent] = populated()
        world.give(agent, Path((Goal((0.0, 1.0, 0.0), dwell=2.0), Goal((0.0, 3.0, 0.0)))), 0.0)
        chunks = run(world, 12.0, level)
        return [c.seq for c in chunks if c.flags & ChunkFlag.ARRIVED]

    assert arrival(HOLD) == arrival(DegradationLevel(1))


def test_held_agents_leave_the_time_to_others_and_do_not_move_them():
    def walk(level):
        engine = FakeEngine()
        world, agents = populated(6, engine)
        world.give(agents[2], GOAL, 0.0)
        return own(run(world, 3.0, level), 3), sum(rows for _, rows, _ in engine.calls)

    (held, few), (stepped, many) = walk(HOLD), walk(DegradationLevel(1))
    assert few == many / 6
    for a, b in zip(held, stepped, strict=True):
        np.testing.assert_array_equal(a.translation, b.translation)


def test_under_pressure_candidates_go_first_then_the_idle_are_held_then_it_comes_back():
    steering = Steering().with_search(candidates=2)
    world, agents = populated(4, budget=BudgetRules(), steering=steering, phases=1)
    world.give(agents[0], Goal((0.0, 90.0, 0.0)), 0.0)
    chunks, levels = [], []
    for _ in range(10):
        chunks += world.tick(world.next_event() + 0.23)
        levels.append(world.load.level_number)
    assert levels == sorted(levels) and levels[-1] == 4
    walker = own(chunks, 1)
    assert not any(c.flags & ChunkFlag.HELD for c in walker)
    assert walker[-1].flags & ChunkFlag.REDUCED
    assert all(own(chunks, alias)[-1].flags & ChunkFlag.HELD for alias in (2, 3, 4))
    assert world.scheduler.unstepped.held_steps > 0
    calm = list(world.advance(40.0))
    assert world.load.level_number == 0
    last = [own(calm, alias)[-1] for alias in (1, 2, 3, 4)]
    assert all(c.candidates == 2 and not c.flags & ChunkFlag.HELD for c in last)
    for alias in (1, 2, 3, 4):
        assert is_seamless(own([*chunks, *calm], alias))


def test_states_are_counted():
    world, agents = populated(3)
    world.give(agents[0], GOAL, 0.0)
    list(world.advance(1.0))
    counts = {state: count for state, count in agents_by_state(world.slots).items() if count}
    assert counts == {AgentState.WALKING: 1, AgentState.STANDING: 2}


# A session that waits for its reader


def two_sessions(**settings):
    world = make_world(**settings)
    made = []
    for name in ("slow", "quick"):
        world.create_session(SessionSpec(name), 0.0)
        infos = world.create_agents(name, people(3), 0.0)
        made.append([info.agent_id for info in infos])
        world.give(made[-1][0], Goal((0.0, 20.0, 0.0)), 0.0)
    return world, *made


def of(chunks, agents):
    found = {agent: [c for c in chunks if c.agent_id == agent] for agent in agents}
    return list(found.values())


@pytest.mark.parametrize("lead", [1, 3])
def test_a_held_session_loses_nothing_and_the_others_notice_nothing(lead):
    world, slow, quick = two_sessions(lead=lead)
    same, _, same_quick = two_sessions(lead=lead)
    reference = list(same.advance(8.0))
    before = list(world.advance(2.0))
    during, now = [], 2.0
    while now < 5.0:  # as the loop does: again and again, a little longer
        world.hold("slow", now + 0.5)
        now += 0.1
        during += world.advance(now)
    last_hold = now - 0.1 + 0.5
    after = list(world.advance(8.0))
    assert {c.agent_id for c in during} == set(quick)
    for held in of([*before, *during, *after], slow):
        assert is_seamless(held)
        times = np.array([c.scheduled_at for c in held])
        waits = np.diff(times)
        assert sum(waits > STEP_SECONDS + 1e-6) == 1
        resumed = times[int(np.argmax(waits)) + 1]
        assert last_hold - 1e-3 <= resumed < last_hold + STEP_SECONDS
        steps = waits / STEP_SECONDS
        np.testing.assert_allclose(steps, steps.round(), atol=1e-6)
    undisturbed = of([*before, *during, *after], quick)
    for found, expected in zip(undisturbed, of(reference, same_quick), strict=True):
        assert [c.scheduled_at for c in found] == [c.scheduled_at for c in expected]
        for chunk, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(chunk.translation, other.translation)
    assert not world.skip(8.0).any()


def test_a_goal_given_while_it_waits_counts_when_it_goes_on():
    world, slow, _ = two_sessions()
    before = list(world.advance(2.0))
    world.hold("slow", 6.0)
    list(world.advance(3.0))
    world.give(slow[1], Goal((2.0, 5.0, 0.0)), 3.0)
    after = list(world.advance(8.0))
    [_, track, _] = of([*before, *after], slow)
    assert is_seamless(track)
    first = next(c for c in track if c.goal_revision == 1)
    assert 6.0 <= first.scheduled_at < 6.2 + STEP_SECONDS


def test_holding_needs_a_session_and_may_find_it_empty():
    world, _, _ = two_sessions()
    world.create_session(SessionSpec("empty"), 0.0)
    world.hold("empty", 9.0)
    with pytest.raises(NotFound):
        world.hold("nowhere", 9.0)
    list(world.advance(1.0))
    world.hold("slow", 0.5)  # in the past: nothing to wait for
    assert len({c.agent_id for c in world.advance(1.3)}) == 6
