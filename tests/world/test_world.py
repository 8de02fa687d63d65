"""The runtime's promises, kept by the synchronous core with a manual clock."""

import math
from collections import defaultdict

import numpy as np
import pytest

from tests.world.fakes import GOAL, FakeEngine, make_world, people, populated
from wayfarer.config.limits import Limits
from wayfarer.spec import NEW_FRAMES, STEP_SECONDS
from wayfarer.world.agents.agent import AgentState, ChunkFlag, SessionSpec, Sight
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.slots import Mode
from wayfarer.world.behaviours import Wander
from wayfarer.world.goals.commands import Path, Stop
from wayfarer.world.goals.steering import Steering
from wayfarer.world.stepping.budget import BudgetRules

FAR = Goal((0.0, 50.0, 0.0))


def by_agent(chunks):
    found = defaultdict(list)
    for chunk in chunks:
        found[chunk.alias].append(chunk)
    return found


def test_chunks_follow_each_other_without_a_hole():
    world, _ = populated(5)
    tracks = by_agent(world.advance(4.0))
    assert len(tracks) == 5
    for chunks in tracks.values():
        assert [c.seq for c in chunks] == list(range(len(chunks)))
        assert [c.first_frame for c in chunks] == [NEW_FRAMES * c.seq for c in chunks]
        times = [c.scheduled_at for c in chunks]
        np.testing.assert_allclose(np.diff(times), STEP_SECONDS)
        assert times[0] >= STEP_SECONDS and times[-1] <= 4.0
        assert chunks[0].translation.shape == (8, 3)
        assert chunks[0].rotations.shape == (8, 22, 4)
        assert chunks[0].contacts.shape == (8, 2) and chunks[0].contacts.dtype == np.bool_


def test_a_chunk_leaves_at_its_time_and_not_before():
    world, _ = populated()
    first = world.next_event()
    world.tick(first)
    due = first + STEP_SECONDS
    assert world.collect(due - 0.01) == []
    assert [c.seq for c in world.collect(due)] == [0]


def test_what_is_being_made_for_those_who_leave_is_lost():
    """A long engine call ends after its session was packed for another server."""
    world, _ = populated(2)
    list(world.advance(1.0))
    while (step := world.schedule(world.next_event())) is None:
        world.collect(world.next_event())
    session = world.registry.session("s")
    assert not world.members.freeze(session, True), "a call is under way"
    world.take_rest("s")
    world.apply(step)
    assert world.collect(1000.0) == []
    world.members.freeze(session, False)
    assert {chunk.alias for chunk in world.advance(3.0)} == {1, 2}, "who stays goes on"


def test_walks_to_its_goal_arrives_once_and_stands():
    world, [agent] = populated()
    world.give(agent, GOAL, 0.0)
    chunks = list(world.advance(12.0))
    assert sum(bool(c.flags & ChunkFlag.ARRIVED) for c in chunks) == 1
    assert chunks[0].state is AgentState.WALKING
    assert AgentState.STOPPING in {c.state for c in chunks}
    info = world.get_agent(agent)
    assert info.state is AgentState.STANDING
    assert math.dist(info.position[:2], GOAL.position[:2]) < GOAL.radius
    assert info.goal == GOAL and info.goal_revision == 1


def test_goes_on_to_the_next_goal_from_where_it_stands():
    world, [agent] = populated()
    for number, place in enumerate([(0.0, 3.0, 0.0), (3.0, 3.0, 0.0), (0.0, 0.0, 0.0)]):
        assert world.give(agent, Goal(place), 20.0 * number) == number + 1
        chunks = list(world.advance(20.0 * (number + 1)))
        assert sum(bool(c.flags & ChunkFlag.ARRIVED) for c in chunks) == 1
        assert math.dist(world.get_agent(agent).position[:2], place[:2]) < 0.3


def test_agents_made_together_are_stepped_in_turns():
    engine = FakeEngine()
    world, _ = populated(64, engine)
    list(world.advance(3.0))
    engine.calls.clear()
    list(world.advance(4.0))
    assert {rows for _, rows, _ in engine.calls} == {32}  # 64 agents in 2 phases
    assert len(engine.calls) == 5 * 2, "a phase holds one gender while it can"


def test_batches_are_padded_to_warmed_sizes():
    engine = FakeEngine()
    world, _ = populated(26, engine, phases=1, batch_sizes=(4, 16))
    list(world.advance(0.5))
    assert {rows for _, rows, _ in engine.calls} == {16}


def test_a_batch_is_no_larger_than_the_largest_size():
    engine = FakeEngine()
    world, _ = populated(26, engine, phases=1, batch_sizes=(4,))
    tracks = by_agent(world.advance(1.0))
    assert {rows for _, rows, _ in engine.calls} == {4}
    assert {len(chunks) for chunks in tracks.values()} == {4}


def test_replan_replaces_only_what_has_not_been_sent():
    world, [agent] = populated()
    world.give(agent, GOAL, 0.0)
    sent = list(world.advance(2.01))
    asked = 2.05
    assert world.give(agent, Goal((5.0, 0.0, 0.0)), asked) == 2
    after = list(world.advance(4.0))
    first = after[0]
    assert first.seq == sent[-1].seq + 1, "no number is used twice or left out"
    assert first.flags & ChunkFlag.REPLANNED and first.goal_revision == 2
    assert not any(c.flags & ChunkFlag.REPLANNED for c in [*sent, *after[1:]])
    assert first.scheduled_at - asked <= 0.25, "within one primitive"
    # It continues from the last sent frame, and now along X.
    step = first.translation[0] - sent[-1].translation[-1]
    assert 0 < step[0] < 0.1 and abs(step[1]) < abs(step[0])


@pytest.mark.parametrize("asked", np.arange(2.0, 2.2, 0.011).round(3))
def test_a_goal_takes_effect_within_one_primitive_whenever_it_comes(asked):
    world, [agent] = populated()
    list(world.advance(asked))
    world.give(agent, GOAL, asked)
    chunks = list(world.advance(asked + 1.0))
    changed = next(c for c in chunks if c.goal_revision == 1)
    assert asked <= changed.scheduled_at <= asked + 0.25
    assert changed.state is AgentState.WALKING


def test_what_falls_due_at_once_is_kept():
    world, [agent] = populated(replan_margin=0.04)
    sent = list(world.advance(2.0))
    due = sent[-1].scheduled_at + STEP_SECONDS
    world.give(agent, GOAL, due - 0.02)
    kept, changed = list(world.advance(due + STEP_SECONDS))
    assert (kept.goal_revision, changed.goal_revision) == (0, 1)
    assert not (kept.flags | changed.flags) & ChunkFlag.REPLANNED


def test_replan_with_a_longer_lead_goes_back_to_the_last_sent_frame():
    world, [agent] = populated(lead=3)
    world.give(agent, GOAL, 0.0)
    sent = list(world.advance(2.0))
    world.give(agent, Goal((5.0, 0.0, 0.0)), 2.05)
    after = list(world.advance(3.0))
    assert [c.seq for c in after] == list(range(sent[-1].seq + 1, sent[-1].seq + 1 + len(after)))
    assert all(c.goal_revision == 2 for c in after)
    assert np.abs(after[0].translation[0] - sent[-1].translation[-1]).max() < 0.1


@pytest.mark.parametrize("command", [FAR, Path((FAR, GOAL))])
def test_who_is_stopped_comes_to_a_stand(command):
    world, [agent] = populated()
    world.give(agent, command, 0.0)
    list(world.advance(3.0))
    assert world.give(agent, Stop(), 3.0) == 2
    before = world.get_agent(agent)
    assert (before.goal, before.waypoint, before.waypoints) == (None, 0, 0)
    chunks = list(world.advance(6.0))
    info = world.get_agent(agent)
    assert info.state is AgentState.STANDING and info.goal is None
    assert -0.01 < info.position[1] - before.position[1] < 1.0
    assert not any(c.flags & ChunkFlag.ARRIVED for c in chunks)


def test_when_time_is_short_fewer_candidates_are_tried_and_it_is_told():
    engine = FakeEngine()
    asked = 8
    steering = Steering().with_search(candidates=asked)
    world, _ = populated(2, engine, budget=BudgetRules(), steering=steering, phases=1)
    in_time = list(world.advance(1.0))
    assert {c.candidates for c in in_time} == {asked}
    assert not any(c.flags & ChunkFlag.REDUCED for c in in_time)
    late = [c for _ in range(3) for c in world.tick(world.next_event() + 0.23)]
    assert {c.candidates for c in late} & {2, 1}
    assert all(bool(c.flags & ChunkFlag.REDUCED) == (c.candidates < asked) for c in late)
    assert (
        world.scheduler.reduced_steps == sum(rows for _, rows, k in engine.calls if k < asked) > 0
    )
    calm = list(world.advance(30.0))
    assert calm[-1].candidates == asked, "it comes back by itself"


def test_without_a_budget_nothing_depends_on_when_it_is_called():
    world, _ = populated(2, phases=1)
    list(world.advance(1.0))
    asked = Steering().searches[Mode.STANDING].candidates
    assert {c.candidates for c in world.tick(5.0)} == {asked}
    assert world.scheduler.reduced_steps == 0


@pytest.mark.parametrize(
    "command", [GOAL, Path((GOAL, Goal((3.0, 5.0, 0.0)))), Wander((5.0, 5.0), 3.0)]
)
def test_a_slot_that_is_used_again_starts_afresh(command):
    world, [first] = populated(limits=Limits(agents=1))
    world.give(first, command, 0.0)
    list(world.advance(1.1))  # a chunk is planned and waits
    world.delete_agent(first)
    assert world.collect(9.0) == []
    [second] = world.create_agents("s", people(1, position=(7.0, 7.0)), 1.15)
    assert second.alias == 2, "aliases are never used twice"
    assert second.goal is None and second.state is AgentState.STANDING
    chunks = list(world.advance(3.0))
    assert chunks[0].seq == 0 and chunks[0].agent_id == second.agent_id
    assert math.dist(chunks[0].translation[0, :2], (7, 7)) < 0.1
    assert {chunk.state for chunk in chunks} == {AgentState.STANDING}


def test_a_broken_row_stands_where_it_was_and_spoils_no_other():
    def run(broken):
        engine = FakeEngine()
        world = make_world(engine, phases=1)
        world.create_session(SessionSpec("s", avoid=False), 0.0)
        specs = people(3, gender="male")
        specs[1] = people(1, gender="male", betas=(1.5, *[0.0] * 9), position=(2.0, 1.0))[0]
        ids = [a.agent_id for a in world.create_agents("s", specs, 0.0)]
        for agent_id in ids:
            world.give(agent_id, GOAL, 0.0)
        chunks = list(world.advance(1.0))
        engine.nan_for_beta = 1.5 if broken else None
        chunks += world.advance(2.0)
        engine.nan_for_beta = None
        return world, ids, by_agent(chunks + list(world.advance(8.0)))

    world, ids, found = run(broken=True)
    _, _, expected = run(broken=False)
    for alias in (1, 3):
        for a, b in zip(found[alias], expected[alias], strict=True):
            np.testing.assert_array_equal(a.translation, b.translation)
    assert world.scheduler.resets == 5
    assert all(np.isfinite(c.translation).all() for c in found[2])
    marked = [c for c in found[2] if c.flags & ChunkFlag.FIRST]
    assert len(marked) == 5 and all(c.state is AgentState.STANDING for c in marked)
    places = np.concatenate([c.translation for c in found[2]])
    assert np.abs(np.diff(places, axis=0)).max() < 0.1, "it is not thrown elsewhere"
    assert math.dist(world.get_agent(ids[1]).position[:2], GOAL.position[:2]) < 0.3, "and walks on"


def test_an_engine_that_raises_leaves_everything_as_it_was():
    engine = FakeEngine()
    world, _ = populated(3, engine)
    before = by_agent(world.advance(1.0))
    engine.fail_next = 1
    event = world.next_event()
    with pytest.raises(RuntimeError, match="broke down"):
        world.tick(event)
    after = by_agent(world.advance(2.0))
    reference = by_agent(populated(3)[0].advance(2.0))
    for alias, chunks in reference.items():
        found = before[alias] + after[alias]
        # Chunks that the failing tick had sent are lost with it, but planned ones are not.
        assert [c.seq for c in chunks][-3:] == [c.seq for c in found][-3:]
        np.testing.assert_array_equal(chunks[-1].translation, found[-1].translation)


def test_primitives_that_are_over_are_left_out_and_the_rest_follows_in_its_rhythm():
    world, _ = populated(3)
    before = by_agent(world.advance(1.0))
    assert not world.skip(1.0).any() and not world.skip(1.15).any()
    world.see("s", np.array([0]), [Sight.ROOT])
    by_sight = world.skip(4.0)
    assert by_sight.sum() == sum(
        int((4.0 - chunks[-1].scheduled_at - STEP_SECONDS + 1e-4) / STEP_SECONDS)
        for chunks in before.values()
    )
    assert (by_sight > 0).tolist() == [True, False, True, False], "two near, and one as a root"
    after = by_agent(world.advance(5.0))
    for alias, chunks in before.items():
        first, last = after[alias][0], chunks[-1]
        assert first.seq == last.seq + 1
        assert 0 <= 4.0 - first.scheduled_at < STEP_SECONDS
        steps = (first.scheduled_at - last.scheduled_at) / STEP_SECONDS
        assert steps == pytest.approx(round(steps)), "in its phase"
        np.testing.assert_allclose(first.translation[0], last.translation[-1], atol=0.05)


def test_only_who_is_late_is_put_off():
    def newcomer(skips):
        world, _ = populated(2)
        list(world.advance(1.0))
        world.create_session(SessionSpec("new"), 3.0)
        [info] = world.create_agents("new", people(1), 3.0)
        assert not skips or world.skip(3.1).any()
        return [c.scheduled_at for c in world.advance(4.0) if c.agent_id == info.agent_id]

    assert newcomer(skips=True) == newcomer(skips=False)


def test_behind_time_agents_catch_up_in_order():
    world, _ = populated(3)
    list(world.advance(1.0))
    tracks = by_agent(world.tick(2.0))
    for chunks in tracks.values():
        seqs = [c.seq for c in chunks]
        assert len(seqs) == 5 and seqs == sorted(seqs)


def test_unix_time_is_exact_enough():
    world = make_world()
    now = 1_790_000_000.123
    world.create_session(SessionSpec("s"), now)
    world.create_agents("s", people(3), now)
    chunks = list(world.advance(now + 2.0))
    for chunk in chunks:
        assert chunk.scheduled_at * 40 == pytest.approx(round(chunk.scheduled_at * 40), abs=1e-4)


def test_what_leaves_is_told_by_session_and_has_each_agent_once():
    world = make_world()
    for name in ("s", "t"):
        world.create_session(SessionSpec(name), 0.0)
        world.create_agents(name, people(4), 0.0)
    while world.step(1.0):  # two chunks ahead of everybody, and none is sent
        pass
    late = world.take_due(1.0)
    numbers = {name: [] for name in ("s", "t")}
    for session_id, chunks, slots in late:
        assert world.slots.alias[slots].tolist() == chunks.alias.tolist()
        aliases = chunks.alias.tolist()
        assert len(set(aliases)) == len(aliases)
        assert chunks.scheduled_at.tolist() == sorted(chunks.scheduled_at.tolist())
        numbers[session_id] += [(chunk.alias, chunk.seq) for chunk in chunks]
    everybody = {(alias, seq) for alias in (1, 2, 3, 4) for seq in (0, 1)}
    assert set(numbers["s"]) == set(numbers["t"]) == everybody
    assert len(numbers["s"]) == len(numbers["t"]) == 8
