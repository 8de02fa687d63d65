"""Agents of the fake engine in scenes: ways, obstacles that come and go, goals that cannot be."""

import gc
import math
import weakref
from dataclasses import replace

import numpy as np
import pytest

from tests.world.fakes import HIPS_HEIGHT, taken
from tests.world.scenes.grounds import BOX, FIELD, WALL, enter, field, islands, storeys, world_in
from wayfarer.errors import AlreadyExists, FailedPrecondition, Unreachable
from wayfarer.navigation.scene import bake
from wayfarer.navigation.scene_spec import Box, Floor, SceneSpec
from wayfarer.world.agents.agent import AgentSpec, AgentState, ChunkFlag, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import Follow, Patrol
from wayfarer.world.events import EventKind
from wayfarer.world.goals.commands import Append, Path
from wayfarer.world.scenes.messages import SceneSource
from wayfarer.world.scenes.scene_registry import SceneRegistry

SOUTH, NORTH = (6.0, 2.0), (6.0, 10.0)
CLEAR = 0.2
"""Minimum metres between hips and walls: the radius, less what is cut at corners."""


def goal(x, y, z=0.0, **values):
    return Goal((x, y, z), **values)


def agent_at(place):
    return AgentSpec(position=place)


def walked(world, until):
    """Hips of every frame until the time, by agent, and the agents that arrived."""
    tracks, arrived = {}, set()
    for chunk in world.advance(until):
        tracks.setdefault(chunk.agent_id, []).append(chunk.translation)
        if chunk.flags & ChunkFlag.ARRIVED:
            arrived.add(chunk.agent_id)
    return {name: np.concatenate(parts) for name, parts in tracks.items()}, arrived


def length(track):
    return np.linalg.norm(np.diff(track[:, :2], axis=0), axis=1).sum()


def kinds(world):
    return [event.kind for _, event in world.take_events()]


def test_walks_around_a_box_and_arrives():
    world, _, _ = world_in(field(BOX))
    [agent] = enter(world, SOUTH)
    world.give(agent.agent_id, goal(*NORTH), 0.0)
    tracks, arrived = walked(world, 15.0)
    track = tracks[agent.agent_id]
    assert arrived == {agent.agent_id}
    assert field(BOX).distance(track).min() > CLEAR
    assert length(track) < 1.1 * field(BOX).path(SOUTH, NORTH).length
    assert world.get_agent(agent.agent_id).state is AgentState.STANDING


def test_without_a_scene_the_box_is_not_there():
    world, _, _ = world_in(field(BOX))
    world.create_session(SessionSpec("flat"), 0.0)
    [agent] = world.create_agents("flat", [agent_at(SOUTH)], 0.0)
    world.give(agent.agent_id, goal(*NORTH), 0.0)
    tracks, arrived = walked(world, 15.0)
    assert arrived and field(BOX).distance(tracks[agent.agent_id]).min() < 0


def test_visits_a_path_goal_by_goal_around_walls():
    world, _, _ = world_in(field(BOX))
    [agent] = enter(world, SOUTH)
    places = [(6.0, 10.0), (6.0, 4.0), (10.0, 8.0)]
    world.give(agent.agent_id, Path(tuple([goal(*p) for p in places[:2]])), 0.0)
    world.give(agent.agent_id, Append((goal(*places[2]),)), 0.0)
    tracks, _ = walked(world, 45.0)
    track = tracks[agent.agent_id][:, :2]
    visits = [np.linalg.norm(track - place, axis=1).argmin() for place in places]
    assert visits == sorted(visits)
    assert all(np.linalg.norm(track - place, axis=1).min() < 0.31 for place in places)
    assert field(BOX).distance(track).min() > CLEAR


def test_an_obstacle_in_the_way_is_walked_around_within_half_a_second():
    world, registry, scene_id = world_in(field())
    [agent] = enter(world, SOUTH)
    world.give(agent.agent_id, goal(*NORTH), 0.0)
    before, _ = walked(world, 1.5)
    assert np.abs(before[agent.agent_id][:, 0] - 6.0).max() < 0.1  # straight ahead
    registry.put(scene_id, "crate", BOX)
    after, arrived = walked(world, 2.0)
    assert np.abs(after[agent.agent_id][-1, 0] - 6.0) > 0.1  # aside
    rest, arrived = walked(world, 15.0)
    assert arrived
    assert registry.entry(scene_id).scene.distance(rest[agent.agent_id]).min() > CLEAR


def test_an_obstacle_is_seen_though_a_session_enters_before_the_next_step():
    world, registry, scene_id = world_in(field())
    [agent] = enter(world, SOUTH)
    world.give(agent.agent_id, goal(*NORTH), 0.0)
    walked(world, 1.5)
    registry.put(scene_id, "crate", BOX)
    world.create_session(SessionSpec("other", scene=scene_id), 1.5)
    rest, arrived = walked(world, 15.0)
    assert arrived
    assert registry.entry(scene_id).scene.distance(rest[agent.agent_id]).min() > CLEAR


def test_an_obstacle_elsewhere_changes_nothing():
    tracks = []
    for put in (False, True):
        world, registry, scene_id = world_in(field())
        [agent] = enter(world, SOUTH)
        world.give(agent.agent_id, goal(*NORTH), 0.0)
        before, _ = walked(world, 2.0)
        if put:
            registry.put(scene_id, "crate", Box((1.0, 1.0), (1.0, 1.0), 1.0))
        after, _ = walked(world, 12.0)
        tracks.append(np.concatenate([*before.values(), *after.values()]))
    assert tracks[0].tobytes() == tracks[1].tobytes()


def test_waits_before_a_way_that_is_closed_and_goes_on_when_it_opens():
    world, registry, scene_id = world_in(field())
    [agent] = enter(world, SOUTH)
    world.give(agent.agent_id, goal(*NORTH), 0.0)
    walked(world, 1.0)
    registry.put(scene_id, "wall", WALL)
    walked(world, 8.0)
    assert world.get_agent(agent.agent_id).state is AgentState.STANDING
    assert world.get_agent(agent.agent_id).position[1] < 6.0
    [(session_id, event)] = world.take_events()
    assert (session_id, event.kind) == ("s", EventKind.BLOCKED)
    assert (event.agent_id, event.goal_revision, event.waypoint) == (agent.agent_id, 1, 0)
    assert "no way leads" in str(event.text)
    registry.remove(scene_id, "wall")
    _, arrived = walked(world, 25.0)
    assert arrived == {agent.agent_id}
    assert kinds(world) == []


def test_a_goal_off_free_ground_is_moved_to_the_nearest_and_it_is_told():
    world, _, _ = world_in(field(BOX))
    [agent] = enter(world, SOUTH)
    world.give(agent.agent_id, goal(6.0, 5.9), 0.0)
    moved = world.get_agent(agent.agent_id).goal.position
    assert moved == pytest.approx((6.0, 5.2, 0.0), abs=0.02)
    [(_, event)] = world.take_events()
    assert event.kind is EventKind.GOAL_MOVED and event.goal_revision == 1
    assert "0.71 m" in str(event.text)
    tracks, arrived = walked(world, 10.0)
    assert arrived and math.dist(tracks[agent.agent_id][-1, :2], moved[:2]) < 0.3


def test_a_goal_that_no_way_leads_to_is_refused_and_changes_nothing():
    world, _, _ = world_in(islands())
    [agent] = enter(world, SOUTH)
    world.give(agent.agent_id, goal(*NORTH), 0.0)
    for give in (
        lambda: world.give(agent.agent_id, goal(25.0, 6.0), 0.0),
        lambda: world.give(agent.agent_id, Path((goal(*NORTH), goal(25.0, 6.0))), 0.0),
        lambda: world.give(agent.agent_id, Append((goal(25.0, 6.0),)), 0.0),
    ):
        with pytest.raises(Unreachable, match="no way leads") as refused:
            give()
        assert refused.value.nearest == pytest.approx((11.7, 6.0, 0.0), abs=0.02)
    info = world.get_agent(agent.agent_id)
    assert info.goal_revision == 1 and info.goal.position == (*NORTH, 0.0)


def test_a_goal_that_becomes_unreachable_before_its_turn_is_told_and_waited_for():
    world, registry, scene_id = world_in(field())
    [agent] = enter(world, SOUTH)
    world.give(agent.agent_id, Path((goal(6.0, 4.0), goal(*NORTH))), 0.0)
    registry.put(scene_id, "wall", WALL)
    walked(world, 8.0)
    events = [event for _, event in world.take_events()]
    assert [(e.kind, e.waypoint) for e in events] == [(EventKind.UNREACHABLE, 1)]
    registry.remove(scene_id, "wall")
    tracks, _ = walked(world, 25.0)
    assert math.dist(tracks[agent.agent_id][-1, :2], NORTH) < 0.3


def test_a_goal_behind_a_wall_is_not_reached_through_it():
    thin = Box((6.0, 6.0), (8.0, 0.1), 2.0)
    world, _, _ = world_in(field(thin))
    [agent] = enter(world, (6.0, 5.0))
    world.give(agent.agent_id, goal(6.0, 6.6, radius=1.5), 0.0)
    tracks, arrived = walked(world, 20.0)
    assert arrived
    assert tracks[agent.agent_id][:, 0].max() > 10.0 or tracks[agent.agent_id][:, 0].min() < 2.0


def test_new_agents_stand_on_the_nearest_free_ground():
    world, _, _ = world_in(field(BOX))
    inside, outside, free = enter(world, (6.0, 5.9), (-3.0, 6.0), (2.0, 2.0))
    assert inside.position[:2] == pytest.approx((6.0, 5.2), abs=0.02)
    assert outside.position[:2] == pytest.approx((0.3, 6.0), abs=0.02)
    assert free.position[:2] == (2.0, 2.0)


def test_two_who_meet_make_way_for_each_other_unless_they_shall_not():
    nearest = {}
    for avoid in (True, False):
        world, _, _ = world_in(field(), avoid)
        one, other = enter(world, SOUTH, NORTH)
        world.give(one.agent_id, goal(*NORTH), 0.0)
        world.give(other.agent_id, goal(*SOUTH), 0.0)
        tracks, arrived = walked(world, 20.0)
        assert arrived == {one.agent_id, other.agent_id}
        a, b = (tracks[agent.agent_id][:160, :2] for agent in (one, other))
        nearest[avoid] = np.linalg.norm(a[: len(b)] - b[: len(a)], axis=1).min()
    assert nearest[True] > 0.45 and nearest[False] < 0.1


def test_agents_of_other_sessions_are_not_seen():
    world, _, scene_id = world_in(field())
    world.create_session(SessionSpec("other", scene=scene_id), 0.0)
    [one] = enter(world, SOUTH)
    [other] = world.create_agents("other", [agent_at(NORTH)], 0.0)
    world.give(one.agent_id, goal(*NORTH), 0.0)
    world.give(other.agent_id, goal(*SOUTH), 0.0)
    tracks, _ = walked(world, 12.0)
    assert np.abs(tracks[one.agent_id][:, 0] - 6.0).max() < 0.1


def test_a_session_names_a_scene_that_is_here_and_holds_it():
    world, registry, scene_id = world_in(field())
    with pytest.raises(FailedPrecondition, match="'scene-x' is not here"):
        world.create_session(SessionSpec("x", scene="scene-x"), 0.0)
    with pytest.raises(FailedPrecondition, match="cannot be recorded"):
        world.create_session(SessionSpec("x", scene=scene_id, record=True), 0.0)
    assert registry.entry(scene_id).sessions == ["s"]
    world.delete_session("s")
    assert registry.entry(scene_id).sessions == []


def test_a_world_forgets_a_scene_that_its_last_session_has_left():
    world, registry, scene_id = world_in(replace(field()))  # a copy: `field` keeps its own
    scene = weakref.ref(registry.entry(scene_id).scene)
    enter(world, SOUTH)
    world.delete_session("s")
    registry.delete(scene_id)
    world.step(0.1)
    gc.collect()
    assert scene() is None
    again = registry.create(SceneSource(SceneSpec((FIELD,), (BOX,)))).scene_id
    world.create_session(SessionSpec("s", scene=again), 0.2)
    [agent] = enter(world, SOUTH)
    world.give(agent.agent_id, goal(*NORTH), 0.2)
    tracks, arrived = walked(world, 15.0)
    assert arrived and field(BOX).distance(tracks[agent.agent_id]).min() > CLEAR


def test_a_refused_session_holds_no_scene():
    world, registry, scene_id = world_in(field())
    with pytest.raises(AlreadyExists):
        world.create_session(SessionSpec("s", scene=scene_id), 0.0)
    assert registry.entry(scene_id).sessions == ["s"]


def test_a_session_taken_out_goes_on_in_its_scene_and_not_where_that_is_missing():
    world, _, _ = world_in(field(BOX))
    [agent] = enter(world, SOUTH)
    world.give(agent.agent_id, goal(*NORTH), 0.0)
    walked(world, 3.0)
    record = taken(world)
    elsewhere, _, _ = world_in(field(), registry=SceneRegistry())
    elsewhere.delete_session("s")
    with pytest.raises(FailedPrecondition, match="is not here"):
        elsewhere.members.put_session(record, 3.0)
    world.delete_session("s")
    world.members.put_session(record, 3.0)
    tracks, arrived = walked(world, 15.0)
    assert arrived and field(BOX).distance(tracks[agent.agent_id]).min() > CLEAR


def test_a_slot_that_is_used_again_knows_nothing_of_the_way_before():
    world, _, _ = world_in(field(BOX))
    [first] = enter(world, SOUTH)
    world.give(first.agent_id, goal(*NORTH), 0.0)
    walked(world, 3.0)
    world.delete_agent(first.agent_id)
    [second] = world.create_agents("s", [agent_at((2.0, 10.0))], 3.0)
    world.give(second.agent_id, goal(10.0, 10.0), 3.0)
    tracks, arrived = walked(world, 15.0)
    assert arrived == {second.agent_id}
    assert np.abs(tracks[second.agent_id][:, 1] - 10.0).max() < 0.2


def test_many_ways_are_looked_for_a_few_at_a_time():
    world, _, _ = world_in(field(), avoid=False, path_queries_per_step=2)
    agents = enter(world, *[(1.0 + 0.6 * k, 2.0) for k in range(16)])
    for agent in agents:
        x, _, _ = agent.position
        world.give(agent.agent_id, goal(x, 8.0), 0.0)
    _, arrived = walked(world, 15.0)
    assert len(arrived) == 16


def test_on_a_floor_of_its_height_agents_are_shown_there():
    upstairs = bake(SceneSpec((Floor(field().spec.floors[0].outline, height=3.0),)))
    world, _, _ = world_in(upstairs)
    [agent] = enter(world, SOUTH)
    assert agent.position == pytest.approx((*SOUTH, 3.0 + HIPS_HEIGHT))
    world.give(agent.agent_id, goal(*NORTH), 0.0)
    assert world.get_agent(agent.agent_id).goal.position == (*NORTH, 3.0)
    tracks, arrived = walked(world, 10.0)
    assert arrived
    np.testing.assert_allclose(tracks[agent.agent_id][:, 2], 3.0 + HIPS_HEIGHT, atol=1e-5)


def test_who_is_in_no_scene_walks_as_if_there_were_none():
    """The motion is equal to the bit, also in batches with agents in a scene."""
    tracks = []
    for company in (0, 3):
        world, _, _ = world_in(field(BOX), phases=1)
        world.create_session(SessionSpec("flat"), 0.0)
        [agent] = world.create_agents("flat", [agent_at(SOUTH)], 0.0)
        world.give(agent.agent_id, goal(6.0, 5.0), 0.0)
        for other in enter(world, *[(2.0 + k, 2.0) for k in range(company)]):
            world.give(other.agent_id, goal(*NORTH), 0.0)
        found, _ = walked(world, 6.0)
        tracks.append(found[agent.agent_id])
    assert tracks[0].tobytes() == tracks[1].tobytes()


def test_goals_that_move_are_followed_on_new_ways():
    world, _, _ = world_in(field(BOX), avoid=False)
    leader, follower = enter(world, SOUTH, (5.0, 1.0))
    world.give(leader.agent_id, goal(*NORTH), 0.0)
    world.give(follower.agent_id, Follow(leader.agent_id), 0.0)
    tracks, _ = walked(world, 20.0)
    assert math.dist(tracks[follower.agent_id][-1, :2], NORTH) < 3.0
    assert field(BOX).distance(tracks[follower.agent_id]).min() > CLEAR


def test_a_storey_is_named_by_its_height():
    world, _, _ = world_in(storeys())
    [below] = enter(world, (10.0, 5.0))
    [above] = enter(world, (10.0, 5.0), floor=3.0)
    assert below.position[2] == pytest.approx(HIPS_HEIGHT, abs=0.02)
    assert above.position[2] == pytest.approx(3.0 + HIPS_HEIGHT, abs=0.02)
    world.give(below.agent_id, goal(10.0, 6.0, 3.0), 0.0)
    tracks, arrived = walked(world, 40.0)
    assert arrived == {below.agent_id}  # by the stairs, though the goal is right above
    assert length(tracks[below.agent_id]) > 15.0
    assert world.get_agent(below.agent_id).position[2] == pytest.approx(3.0 + HIPS_HEIGHT, abs=0.1)


@pytest.mark.parametrize(
    ("floor", "z"),
    [(0.0, 0.3), (0.0, 0.9), (0.0, 1.5), (0.0, -0.5), (3.0, 0.3), (3.0, 1.5), (3.0, -0.2)],
)
def test_a_goal_at_any_height_is_walked_to_on_the_ground_below_it(floor, z):
    world, _, _ = world_in(storeys())
    [agent] = enter(world, (8.0, 5.0), floor=floor)
    world.give(agent.agent_id, goal(10.0, 6.0, floor + z), 0.0)
    tracks, arrived = walked(world, 8.0)
    assert arrived == {agent.agent_id} and length(tracks[agent.agent_id]) < 2.5
    told = world.get_agent(agent.agent_id)
    assert told.goal is not None
    assert told.goal.position == pytest.approx((10.0, 6.0, floor), abs=0.02)
    assert told.position[2] == pytest.approx(floor + HIPS_HEIGHT, abs=0.02)


def test_patrolled_places_too():
    world, _, _ = world_in(storeys())
    [agent] = enter(world, (8.0, 5.0))
    places = (goal(10.0, 6.0, 0.9, speed=3.0), goal(8.0, 4.0, 1.6, speed=3.0))
    world.give(agent.agent_id, Patrol(places), 0.0)
    tracks, _ = walked(world, 15.0)
    track = tracks[agent.agent_id]
    assert np.abs(track[:, 2] - HIPS_HEIGHT).max() < 0.05
    for place in places:
        assert np.linalg.norm(track[:, :2] - place.position[:2], axis=1).min() < 0.3
