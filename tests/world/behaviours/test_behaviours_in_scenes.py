"""Behaviours among walls, and among people to avoid."""

import numpy as np
import pytest

from tests.world.scenes.grounds import BOX, enter, field, islands, world_in
from wayfarer.world.agents.agent import AgentState
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import Follow, KeepAway, Part, Patrol, Queue, Routine, Wander


def place(world, agent):
    return np.array(world.get_agent(agent.agent_id).position[:2])


def tracks(world, until):
    found = {}
    for chunk in world.advance(until):
        found.setdefault(chunk.agent_id, []).append(chunk.translation)
    return {name: np.concatenate(parts) for name, parts in found.items()}


def test_wandering_all_over_a_scene_keeps_to_what_can_be_reached():
    world, _, _ = world_in(islands())
    [agent] = enter(world, (6.0, 6.0))
    revision = world.give(agent.agent_id, Wander(None, speed=2.0), 0.0)
    [track] = tracks(world, 40.0).values()
    info = world.get_agent(agent.agent_id)
    assert info.goal_revision == revision and info.waypoint >= 4
    assert np.ptp(track[:, :2], axis=0).min() > 4.0
    assert (track[:, :2] > 0.2).all() and (track[:, :2] < 11.8).all()


def test_a_follower_goes_around_the_box_too():
    world, _, _ = world_in(field(BOX))
    leader, follower = enter(world, (6.0, 3.0), (6.0, 1.5))
    world.give(follower.agent_id, Follow(leader.agent_id), 0.0)
    world.give(leader.agent_id, Goal((6.0, 10.0, 0.0)), 0.0)
    walked = tracks(world, 25.0)
    assert field(BOX).distance(walked[follower.agent_id]).min() > 0.2
    apart = np.linalg.norm(place(world, leader) - place(world, follower))
    assert 0.5 < apart < 2.0 and place(world, follower)[1] > 7.5
    assert world.get_agent(follower.agent_id).state is AgentState.STANDING


def test_who_flees_does_not_flee_through_walls():
    world, _, _ = world_in(field(BOX))
    shy, threat = enter(world, (6.0, 4.5), (6.0, 2.5))
    world.give(shy.agent_id, KeepAway(threat.agent_id, distance=3.0), 0.0)
    walked = tracks(world, 10.0)
    assert field(BOX).distance(walked[shy.agent_id]).min() > 0.2
    assert np.linalg.norm(place(world, shy) - place(world, threat)) > 2.9


def test_a_queue_stands_beside_the_wall_it_would_run_into():
    world, _, _ = world_in(field(BOX), phases=4)
    agents = enter(world, (5.5, 2.0), (6.5, 2.0), (6.0, 1.2))
    for agent in agents:
        # heads are at the wall: the place itself is not free
        world.give(agent.agent_id, Queue("bar", (6.0, 5.4), heading=0.0), 0.0)
    walked = tracks(world, 20.0)
    assert all(field(BOX).distance(track).min() > 0.2 for track in walked.values())
    ys = sorted(place(world, agent)[1] for agent in agents)
    assert np.allclose(np.diff(ys), 0.8, atol=0.35)


def test_a_routine_patrols_and_then_goes_anywhere():
    world, _, _ = world_in(field(BOX))
    [agent] = enter(world, (2.0, 2.0))
    goals = tuple(Goal((x, y, 0.0), speed=2.0) for x, y in ((10.0, 2.0), (2.0, 2.0)))
    routine = Routine((Part(Patrol(goals), 8.0), Part(Wander(None, speed=2.0))))
    world.give(agent.agent_id, routine, 0.0)
    [first] = tracks(world, 8.0).values()
    assert first[:, 1].max() < 3.0 and np.ptp(first[:, 0]) > 4.0
    [second] = tracks(world, 30.0).values()
    assert second[:, 1].max() > 4.0


def test_a_wanderer_gives_up_a_place_where_somebody_stands():
    world, _, _ = world_in(field())
    agents = enter(world, (3.0, 6.0), (6.0, 6.0))
    area = Wander((6.0, 6.0), 0.5)
    for moment in range(3):  # the other agent stands next to the third place
        world.give(agents[0].agent_id, area, float(moment))
    walked = tracks(world, 30.0)
    apart = np.linalg.norm(
        walked[agents[0].agent_id][:, None, :2][::20] - walked[agents[1].agent_id][None, ::20, :2],
        axis=-1,
    )
    assert apart.min() > 0.4
    assert world.get_agent(agents[0].agent_id).waypoint > 1


@pytest.mark.parametrize(("stuck", "gives_up"), [(3.0, False), (4.2, True)])
def test_a_wanderer_gives_up_a_place_that_it_gets_no_nearer_to(stuck, gives_up):
    """It has made way meanwhile: it has not `waited`."""
    world, _, _ = world_in(field())
    agent, _ = enter(world, (2.0, 2.0), (2.0, 9.0))
    world.give(agent.agent_id, Wander((9.0, 9.0), 2.0), 0.0)
    tracks(world, 0.5)
    before, planned = world.get_agent(agent.agent_id).goal, world.slots.planned
    slot = int(planned.aims.wants.argmax())
    planned.aims.stuck[slot], planned.memory.waited[slot] = stuck, 0.0
    tracks(world, 0.9)
    assert (world.get_agent(agent.agent_id).goal != before) == gives_up
