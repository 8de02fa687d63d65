"""Agents on paths: goals in turn, waypoints, dwells, headings."""

import math

import numpy as np
import pytest

from tests.world.fakes import FakeEngine, populated
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import AgentState, ChunkFlag
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.commands import Path

SQUARE = [(0.0, 3.0, 0.0), (3.0, 3.0, 0.0), (3.0, 0.0, 0.0), (0.0, 0.0, 0.0)]


def speeds(chunks):
    """Mean speed of each chunk in m/s."""
    hips = np.concatenate([c.translation[-1:, :2] for c in chunks])
    return np.linalg.norm(np.diff(hips, axis=0), axis=-1) / STEP_SECONDS


def test_visits_the_goals_of_a_path_in_turn_and_stands_at_each():
    world, [agent] = populated()
    assert world.give(agent, Path(tuple(Goal(place) for place in SQUARE)), 0.0) == 1
    chunks = list(world.advance(40.0))
    arrived = [c for c in chunks if c.flags & ChunkFlag.ARRIVED]
    assert [c.waypoint for c in arrived] == [0, 1, 2, 3]
    for chunk, place in zip(arrived, SQUARE, strict=True):
        assert np.linalg.norm(chunk.translation[:, :2] - place[:2], axis=-1).min() <= 0.3
    stood = {c.waypoint for c in chunks if c.state is AgentState.STANDING}
    assert stood == {0, 1, 2, 3}
    assert {c.goal_revision for c in chunks} == {1}, "one revision for the whole path"
    info = world.get_agent(agent)
    assert (info.waypoint, info.waypoints, info.goal) == (3, 4, Goal(SQUARE[3]))


def test_waypoints_are_passed_without_stopping_or_slowing():
    world, [agent] = populated()
    line = [Goal((0.0, y, 0.0), stop=False) for y in (2.0, 4.0, 6.0)] + [Goal((0.0, 8.0, 0.0))]
    world.give(agent, Path(tuple(line)), 0.0)
    chunks = list(world.advance(20.0))
    passing = [c for c in chunks if c.waypoint < 3]
    assert {c.state for c in passing} == {AgentState.WALKING}
    np.testing.assert_allclose(speeds(passing)[1:], 1.2, rtol=0.01)  # under way
    assert [c.waypoint for c in chunks if c.flags & ChunkFlag.ARRIVED] == [0, 1, 2, 3]
    assert world.get_agent(agent).state is AgentState.STANDING


def test_after_a_last_waypoint_to_pass_it_stops_beyond():
    world, [agent] = populated()
    world.give(agent, Goal((0.0, 3.0, 0.0), stop=False), 0.0)
    chunks = list(world.advance(8.0))
    assert sum(bool(c.flags & ChunkFlag.ARRIVED) for c in chunks) == 1
    info = world.get_agent(agent)
    assert info.state is AgentState.STANDING
    assert math.dist(info.position[:2], (0, 3)) < 1.5


def test_dwells_before_it_goes_on():
    world, [agent] = populated()
    world.give(agent, Path((Goal((0.0, 1.0, 0.0), dwell=3.0), Goal((0.0, 2.0, 0.0)))), 0.0)
    chunks = list(world.advance(12.0))
    stood = [c for c in chunks if c.state is AgentState.STANDING and c.waypoint == 0]
    assert 3.0 <= len(stood) * STEP_SECONDS <= 3.5
    assert world.get_agent(agent).waypoint == 1


def test_a_new_goal_replaces_the_path_and_its_place_in_it():
    world, [agent] = populated()
    world.give(agent, Path(tuple(Goal((0.0, y, 0.0), stop=False) for y in (1.0, 2.0, 9.0))), 0.0)
    list(world.advance(3.01))
    assert world.get_agent(agent).waypoint == 2
    assert world.give(agent, Goal((5.0, 3.0, 0.0)), 3.05) == 2
    info = world.get_agent(agent)
    assert (info.waypoint, info.waypoints) == (0, 1)
    after = list(world.advance(12.0))
    assert after[0].flags & ChunkFlag.REPLANNED
    assert {(c.goal_revision, c.waypoint) for c in after} == {(2, 0)}
    assert math.dist(world.get_agent(agent).position[:2], (5.0, 3.0)) < 0.3


def test_a_waypoint_reached_in_frames_that_are_thrown_away_was_not_reached():
    """The place in a path belongs to the motion: with a long lead it is ahead of sent chunks."""
    world, [agent] = populated(lead=3)
    world.give(agent, Path((Goal((0.0, 1.0, 0.0), stop=False), Goal((0.0, 9.0, 0.0)))), 0.0)
    sent = []
    while world.get_agent(agent).waypoint == 0:
        sent += world.tick(world.next_event())
    now = sent[-1].scheduled_at + 0.01
    assert sent[-1].waypoint == 0 and not any(c.flags & ChunkFlag.ARRIVED for c in sent)
    world.give(agent, Path((Goal((0.0, 1.0, 0.0), stop=False), Goal((9.0, 1.0, 0.0)))), now)
    after = list(world.advance(12.0))
    assert after[0].flags & ChunkFlag.REPLANNED
    assert [c.waypoint for c in after if c.flags & ChunkFlag.ARRIVED] == [0, 1]


def test_a_reset_on_the_way_keeps_the_place_in_the_path():
    engine = FakeEngine()
    world, [agent] = populated(engine=engine)
    world.give(agent, Path((Goal((0.0, 1.0, 0.0), stop=False), Goal((0.0, 4.0, 0.0)))), 0.0)
    list(world.advance(2.0))
    engine.nan_for_beta = 0.0
    list(world.advance(2.5))
    engine.nan_for_beta = None
    assert world.scheduler.resets and world.get_agent(agent).waypoint == 1
    chunks = list(world.advance(9.0))
    assert {c.waypoint for c in chunks} == {1}
    assert math.dist(world.get_agent(agent).position[:2], (0.0, 4.0)) < 0.3


def test_turns_on_the_spot_to_the_heading_of_its_goal():
    world, [agent] = populated()
    world.give(agent, Goal((0.0, 0.0, 0.0), heading=math.radians(120)), 0.0)
    chunks = list(world.advance(8.0))
    states = [c.state for c in chunks]
    assert states[0] is AgentState.TURNING and states[-1] is AgentState.STANDING
    info = world.get_agent(agent)
    assert abs(math.degrees(info.heading) - 120) <= 15
    # a model that follows its request walks a part of the circle that a turn requests
    assert math.dist(info.position[:2], (0, 0)) < 0.5


def test_strafes_and_faces_its_heading_on_the_way():
    world, [agent] = populated()
    world.give(agent, Goal((0.0, 5.0, 0.0), heading=math.radians(90), strafe=True), 0.0)
    states = [c.state for c in world.advance(2.0)]
    assert states == sorted(states, key=[AgentState.TURNING, AgentState.WALKING].index)
    assert math.degrees(world.get_agent(agent).heading) == pytest.approx(90, abs=20)
    list(world.advance(8.0))
    assert math.dist(world.get_agent(agent).position[:2], (0.0, 5.0)) < 0.3
