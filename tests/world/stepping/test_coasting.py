"""Agents that are seen only as a root continue without the model when time is short."""

import numpy as np
import pytest

from tests.world.fakes import FakeEngine, people, populated
from tests.world.stepping.test_world_ladder import is_seamless, run
from wayfarer.runtime.streams.root_tracks import RootTracks
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS, SEED_FRAMES, STEP_SECONDS
from wayfarer.world.agents.agent import AgentState, ChunkFlag, SessionSpec, Sight
from wayfarer.world.agents.goal import Goal, GoalColumns
from wayfarer.world.agents.heading import facing_at, facing_of
from wayfarer.world.agents.slots import Gait, Mode, Seeds
from wayfarer.world.goals.gait_rules import Targets
from wayfarer.world.goals.steering import Steering
from wayfarer.world.stepping.budget import DegradationLevel
from wayfarer.world.stepping.coasting import TURN, coast

SHORT = DegradationLevel(1, by_sight=True)
FAR_GOAL = Goal((0.0, 30.0, 0.0))


def walkers(headings, speeds):
    """Gaits and seeds of people at the origin, with headings and speeds; markers are the hips."""
    count = len(headings)
    gait, seed = Gait.empty(count), Seeds.empty(count)
    gait.mode[:], gait.speed[:] = Mode.WALKING, speeds
    seed.rotations[..., 3] = 1
    half = np.array(headings) / 2
    seed.rotations[:, :, 0] = np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], -1)[
        :, None
    ]
    facing = np.array([facing_at(heading) for heading in headings])
    seed.translation[..., 2] = 0.9
    for frame in range(SEED_FRAMES):
        way = (frame - SEED_FRAMES + 1) * 0.03 * facing
        seed.translation[:, frame, :2] = way
        seed.markers[:, frame, :, :2] = way[:, None] + 0.1 * facing[:, None]
    return gait, seed


def step(gait, seed, places, speeds, chunk=0):
    goals = GoalColumns.empty(len(gait.mode))
    goals.speed[:] = speeds
    places, speeds = np.array(places, np.float32), np.array(speeds, np.float32)
    facing = np.zeros_like(places)
    chunks = np.full(len(places), chunk)
    return coast(seed, gait, Targets(places, speeds, facing), goals, chunks)


def test_it_goes_straight_on_at_the_speed_asked_for():
    gait, seed = walkers([0.0, 0.0], [1.2, 0.6])
    translation, rotations, contacts, end = step(gait, seed, [(0, 9), (0, 9)], [1.2, 1.0])
    assert translation.shape == (2, NEW_FRAMES, 3) and rotations.shape[1:] == (8, POSED_JOINTS, 4)
    assert contacts.any(-1).all(), "one foot at least is on the floor"
    np.testing.assert_allclose(translation[0, :, 1], 0.03 * np.arange(1, 9), atol=1e-5)
    assert translation[1, -1, 1] == pytest.approx(0.8 * STEP_SECONDS, abs=1e-5), "faster by degrees"
    np.testing.assert_allclose(translation[..., 2], 0.9)
    # the seed moves with it, at the former speed
    np.testing.assert_allclose(end.translation[:, -1], translation[:, -1], atol=1e-6)
    np.testing.assert_allclose(
        np.diff(end.markers, axis=1), np.diff(seed.markers, axis=1), atol=1e-6
    )


def test_it_turns_to_where_it_goes_by_degrees_and_takes_its_seed_along():
    gait, seed = walkers([0.0], [1.2])
    translation, rotations, _, end = step(gait, seed, [(9, 0)], [1.2])
    assert translation[0, -1, 0] == pytest.approx(0.24, abs=1e-5)
    turned = np.arccos(facing_of(rotations[0, -1, 0]) @ [0, 1])
    assert turned == pytest.approx(TURN, abs=1e-4)
    ahead = end.markers[0, -1, 0, :2] - end.translation[0, -1, :2]
    np.testing.assert_allclose(ahead, 0.1 * facing_of(rotations[0, -1, 0]), atol=1e-5)
    np.testing.assert_allclose(facing_of(end.rotations[:, -1, 0]), facing_of(rotations[:, -1, 0]))


def test_nobody_goes_beyond_what_is_aimed_at_and_rows_do_not_matter_to_each_other():
    gait, seed = walkers([0.3, 0.0], [1.2, 1.2])
    both = step(gait, seed, [(0.0, 0.1), (0, 9)], [1.2, 1.2], chunk=5)
    assert both[0][0, -1] == pytest.approx([0.0, 0.1, 0.9], abs=1e-6)
    one = np.array([1])
    alone = step(gait.take(one), seed.take(one), [(0, 9)], [1.2], chunk=5)
    for a, b in zip(both[:3], alone[:3], strict=True):
        np.testing.assert_array_equal(a[1:], b)
    np.testing.assert_array_equal(both[3].markers[1:], alone[3].markers)


def distant(count=1, engine=None, sight=Sight.ROOT, **session):
    """A world of people on their way, seen with `sight`, a second after they set off."""
    world, agents = populated(count, engine, steering=Steering(reactions=1), **session)
    for agent in agents:
        world.give(agent, FAR_GOAL, 0.0)
    before = run(world, 2.0)
    world.see("s", np.array([world.registry.agent(a).slot for a in agents]), sight)
    return world, agents, before


def test_the_distant_walk_on_without_engine_calls_and_come_near_without_a_jump():
    engine = FakeEngine()
    world, agents, before = distant(engine=engine)
    engine.calls.clear()
    coasted = run(world, 6.0, SHORT)
    assert engine.calls == []
    assert (
        world.scheduler.unstepped.coasted_steps == len(coasted)
        and world.scheduler.held_share == 1.0
    )
    assert all(c.flags & ChunkFlag.REDUCED and not c.candidates for c in coasted[1:])
    assert all(c.state is AgentState.WALKING for c in coasted)
    slot = np.array([world.registry.agent(agents[0]).slot])
    world.see("s", slot, Sight.NEAR)
    after = run(world, 8.0, SHORT)
    assert engine.calls and not any(c.candidates == 0 for c in after[1:])
    firsts = [c for c in after if c.flags & ChunkFlag.FIRST]
    assert len(firsts) == 1 and firsts[0].candidates, "the pose is another one, and that is told"
    assert is_seamless([*before, *coasted, *after])


def test_the_distant_arrive_and_stop_as_others_do():
    world, agents, _ = distant()
    world.give(agents[0], Goal((0.0, 8.0, 0.0)), 2.0)
    chunks = run(world, 16.0, SHORT)
    assert sum(bool(c.flags & ChunkFlag.ARRIVED) for c in chunks) == 1
    assert chunks[-1].state is AgentState.STANDING and not chunks[-1].candidates
    assert np.linalg.norm(chunks[-1].translation[-1, :2] - [0, 8]) < 0.4


def test_they_turn_and_walk_back_when_a_goal_lies_behind_them():
    world, agents, _ = distant()
    world.give(agents[0], Goal((0.0, -3.0, 0.0)), 2.0)
    chunks = run(world, 16.0, SHORT)
    assert not any(c.candidates for c in chunks[1:])
    assert is_seamless(chunks)
    assert np.linalg.norm(chunks[-1].translation[-1, :2] - [0, -3]) < 0.4
    assert facing_of(chunks[-1].rotations[-1, 0]) @ [0, -1] > 0.9


def test_they_turn_to_their_heading_at_the_end():
    world, agents, _ = distant()
    world.give(agents[0], Goal((3.0, 2.0, 0.0), heading=0.0), 2.0)
    chunks = run(world, 16.0, SHORT)
    assert not any(c.candidates for c in chunks[1:]) and is_seamless(chunks)
    assert np.linalg.norm(chunks[-1].translation[-1, :2] - [3, 2]) < 0.4
    assert facing_of(chunks[-1].rotations[-1, 0]) @ [0, 1] > 0.99


@pytest.mark.parametrize("sight", [Sight.NEAR, Sight.FAR])
def test_who_is_seen_in_a_pose_never_coasts(sight):
    world, _, _ = distant(sight=sight)
    assert all(c.candidates for c in run(world, 4.0, SHORT))


def test_nobody_coasts_while_there_is_time_nor_in_a_recorded_session():
    world, _, _ = distant()
    assert all(c.candidates for c in run(world, 4.0, DegradationLevel(1)))
    world.create_session(SessionSpec("r", record=True), 4.0)
    (made,) = world.create_agents("r", people(1), 4.0)
    world.give(made.agent_id, FAR_GOAL, 4.0)
    world.see("r", np.array([world.registry.agent(made.agent_id).slot]), Sight.NONE)
    recorded = [c for c in run(world, 8.0, SHORT) if c.agent_id == made.agent_id]
    assert recorded and all(c.candidates for c in recorded), "a replay has no readers"


def test_who_is_seen_as_a_root_counts_for_a_quarter_of_what_fits():
    near, far = (distant(4, sight=sight)[0] for sight in (Sight.NEAR, Sight.ROOT))
    for world in (near, far):
        for rows in (1, 16, 256):
            world.load.admission.measured(rows, 1, 0.001 * rows)
    most = near.settings.limits.agents
    assert 0 < near.load.capacity(9.0) < far.load.capacity(9.0) <= most


def test_the_phase_of_a_coasting_root_goes_on_evenly():
    world, _, _ = distant()
    tracks, phases = RootTracks(), []
    while (event := world.next_event()) <= 8.0:
        for due in world.take_due(event):
            phases += tracks.follow(due.chunks)[0, :, 4].tolist()
        world.step(event, SHORT)
    rates = np.remainder(np.diff(phases[30:]), 1.0) * 10  # strides a second
    assert rates.min() > 0.7 and rates.max() < 1.3
