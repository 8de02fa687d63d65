"""Agents among others: shared goals, people in the way, doors. The fake engine walks them."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.world.fakes import make_world
from tests.world.scenes.grounds import enter, field, world_in
from tests.world.scenes.test_world_scenes import goal, walked
from wayfarer.navigation.scene import bake
from wayfarer.navigation.scene_spec import Box, Floor, SceneSpec
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import AgentSpec, SessionSpec
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.route import Passage
from wayfarer.world.agents.slots import Motion, Slots
from wayfarer.world.avoidance.people import People
from wayfarer.world.events import EventKind
from wayfarer.world.scenes.company import REPORT_S, Company
from wayfarer.world.scenes.passages import turns
from wayfarer.world.scenes.planner import Planner
from wayfarer.world.scenes.routes import Routes

CORRIDOR = bake(SceneSpec(floors=(Floor(((0, 0), (2, 0), (2, 16), (0, 16))),)))


def on_floor(*places, **spec):
    """A world without scenes, and agents in session "s"."""
    world = make_world()
    world.create_session(SessionSpec("s", **spec), 0.0)
    specs = [AgentSpec(position=place, noise_seed=k) for k, place in enumerate(places)]
    return world, world.create_agents("s", specs, 0.0)


def nearest(tracks):
    """Minimum distance between the two agents in metres."""
    a, b = (track[:, :2] for track in tracks.values())
    count = min(len(a), len(b))
    return float(np.linalg.norm(a[:count] - b[:count], axis=1).min())


def blocked(world):
    return [event for _, event in world.take_events() if event.kind == EventKind.BLOCKED]


@pytest.mark.parametrize(
    ("spec", "avoids"), [({}, True), ({"avoid": False}, False), ({"record": True}, False)]
)
def test_without_a_scene_agents_avoid_each_other_unless_they_shall_not(spec, avoids):
    world, (one, other) = on_floor((0.0, 0.0), (0.0, 5.0), **spec)
    world.give(one.agent_id, goal(0.0, 5.0), 0.0)
    world.give(other.agent_id, goal(0.0, 0.0), 0.0)
    tracks, arrived = walked(world, 8.0)
    assert arrived == {one.agent_id, other.agent_id}
    assert (nearest(tracks) > 0.42) == avoids


@pytest.mark.parametrize("scene", [True, False])
def test_a_row_of_people_is_walked_around(scene):
    places = [(6.0, 3.0), *((5.1 + 0.6 * k, 6.0) for k in range(4))]
    if scene:
        world, _, _ = world_in(field())
        people = enter(world, *places)
    else:
        world, people = on_floor(*places)
    world.give(people[0].agent_id, goal(6.0, 9.0), 0.0)
    tracks, arrived = walked(world, 10.0)
    assert arrived == {people[0].agent_id}
    assert not blocked(world)
    walker = tracks[people[0].agent_id]
    apart = [np.linalg.norm(walker[:, :2] - place, axis=1).min() for place in places[1:]]
    assert min(apart) > 0.3  # the fake engine turns at once, and cuts the corner


@pytest.mark.parametrize("scene", [True, False])
def test_somebody_in_the_way_is_walked_around_although_somebody_stands_at_the_goal(scene):
    places = [(6.0, 2.0), (6.0, 3.5), (6.0, 8.0)]
    if scene:
        world, _, _ = world_in(field())
        walker, *others = enter(world, *places)
    else:
        world, (walker, *others) = on_floor(*places)
    for agent, place in zip(others, places[1:], strict=True):  # who faces a heading stays
        world.give(agent.agent_id, goal(*place, heading=0.0), 0.0)
    walked(world, 1.0)
    world.give(walker.agent_id, goal(6.0, 8.0), 1.0)
    tracks, arrived = walked(world, 12.0)
    assert arrived == {walker.agent_id}
    assert not blocked(world)
    assert np.linalg.norm(tracks[walker.agent_id][-1, :2] - places[2]) < 1.0


def test_before_people_who_leave_no_way_it_waits_is_told_and_goes_on_when_there_is_one():
    world, _, _ = world_in(CORRIDOR)
    walker, *others = enter(world, (1.0, 5.0), (0.4, 8.0), (1.0, 8.0), (1.6, 8.0))
    for agent, x in zip(others, (0.4, 1.0, 1.6), strict=True):  # who faces a heading stays
        world.give(agent.agent_id, goal(x, 8.0, heading=0.0), 0.0)
    walked(world, 1.0)
    world.give(walker.agent_id, goal(1.0, 10.0), 1.0)
    tracks, arrived = walked(world, 11.0)
    assert not arrived
    [event] = blocked(world)
    assert event.at < 10.0  # it has to get there first
    assert others[1].agent_id in event.detail and walker.agent_id not in event.detail
    track = tracks[walker.agent_id][:, :2]
    assert 0.5 < 8.0 - track[-1, 1] < 1.3
    assert np.linalg.norm(np.diff(track[-200:], axis=0), axis=1).sum() < 0.05  # no steps
    world.delete_agent(others[1].agent_id)
    _, arrived = walked(world, 18.0)
    assert arrived == {walker.agent_id}
    assert not blocked(world)


def test_who_shares_a_goal_stands_beside_it_and_nobody_circles():
    world, people = on_floor(*((4.0 + k, 4.0) for k in range(5)))
    for agent in people:
        world.give(agent.agent_id, goal(6.0, 8.0), 0.0)
    tracks, arrived = walked(world, 15.0)
    assert arrived == {agent.agent_id for agent in people}
    ends = np.array([track[-1, :2] for track in tracks.values()])
    apart = np.linalg.norm(ends[:, None] - ends, axis=-1)[np.triu_indices(5, 1)]
    assert apart.min() > 0.4
    assert np.linalg.norm(ends - (6.0, 8.0), axis=1).max() < 2.0
    for track in tracks.values():
        assert np.linalg.norm(np.diff(track[-200:, :2], axis=0), axis=1).sum() < 0.1


def test_an_agent_beside_its_goal_goes_there_once_nobody_is_in_its_place():
    world, (stays, comes) = on_floor((0.0, 5.0), (0.0, 1.0))
    place = goal(0.0, 5.0)
    world.give(stays.agent_id, goal(0.0, 5.0, heading=0.0), 0.0)  # who faces a heading stays
    walked(world, 1.0)
    world.give(comes.agent_id, place, 1.0)
    tracks, _ = walked(world, 8.0)
    assert np.linalg.norm(tracks[comes.agent_id][-1, :2] - (0.0, 5.0)) > 0.4
    world.give(stays.agent_id, goal(4.0, 5.0), 8.0)
    walked(world, 12.0)
    world.give(comes.agent_id, place, 12.0)
    tracks, arrived = walked(world, 16.0)
    assert comes.agent_id in arrived
    assert np.linalg.norm(tracks[comes.agent_id][-1, :2] - (0.0, 5.0)) < 0.32


def test_a_person_that_waits_knows_where_it_would_go_now_and_for_how_long_it_has_waited():
    """Others are asked to leave that way. It was in another one when it walked last."""
    world, _, _ = world_in(CORRIDOR)
    walker, *others = enter(world, (1.0, 6.5), (0.4, 8.0), (1.0, 8.0), (1.6, 8.0))
    for agent, x in zip(others, (0.4, 1.0, 1.6), strict=True):
        world.give(agent.agent_id, goal(x, 8.0, heading=0.0), 0.0)
    world.give(walker.agent_id, goal(1.0, 11.5), 0.0)
    walked(world, 4.0)
    planned = world.slots.planned
    slot = int(planned.aims.wants.argmax())
    planned.memory.preferred[slot] = planned.memory.chosen[slot] = 1.0, 0.0
    waited = planned.memory.waited[slot]
    walked(world, 5.0)
    x, y = planned.memory.preferred[slot]
    assert y > 0.5 > 5 * abs(x)
    assert not planned.memory.chosen[slot].any()
    assert planned.memory.waited[slot] - waited == pytest.approx(1.0, abs=0.25)


def test_a_person_that_waits_asks_the_nearest_one_in_its_way():
    world, _, _ = world_in(CORRIDOR)
    walker, *others = enter(world, (1.0, 6.5), (0.7, 8.0), (1.3, 8.1))
    for agent, place in zip(others, ((0.7, 8.0), (1.3, 8.1)), strict=True):
        world.give(agent.agent_id, goal(*place, heading=0.0), 0.0)
    world.give(walker.agent_id, goal(1.0, 11.5), 0.0)
    walked(world, 6.0)
    planned = world.slots.planned
    slot = int(planned.aims.wants.argmax())
    hips, asks = planned.seed.translation[:, -1, :2], planned.memory.preferred[slot]
    ways = np.delete(hips, slot, 0) - hips[slot]
    way = ways[np.linalg.norm(ways, axis=1)[:2].argmin()]
    assert way @ asks == pytest.approx(np.linalg.norm(way) * np.linalg.norm(asks), rel=1e-3)


@pytest.mark.parametrize(("off", "close"), [(0.61, True), (0.63, False)])
def test_it_is_noted_which_agents_stand_beside_others(off, close):
    world, _ = on_floor((0.0, 0.0), (off, 0.0))
    walked(world, 1.0)
    company, ahead = world.guide.company, GoalColumns.empty(2)
    company.stand_close(np.arange(2), ahead)
    assert ahead.close.tolist() == [close, close]


def test_a_goal_amid_a_ring_of_people_is_reported():
    world, _, _ = world_in(field())
    turn = 2 * np.pi * np.arange(16) / 16
    ring = [(6.0 + 2.3 * x, 7.0 + 2.3 * y) for x, y in zip(np.cos(turn), np.sin(turn), strict=True)]
    turn = 2 * np.pi * np.arange(12) / 12
    inner = [(6.0 + 0.5 * x, 7.0 + 0.5 * y) for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    inner += [
        (6.0 + 1.4 * x, 7.0 + 1.4 * y) for x, y in zip(np.cos(turn), np.sin(turn), strict=True)
    ]
    walker, *others = enter(world, (6.0, 1.0), *ring, *inner)
    for agent, (x, y) in zip(others, ring + inner, strict=True):  # who faces a heading stays
        world.give(agent.agent_id, goal(x, y, heading=0.0), 0.0)
    walked(world, 1.0)
    world.give(walker.agent_id, goal(6.0, 7.0), 1.0)
    _, arrived = walked(world, 15.0)
    assert not arrived
    first, again = blocked(world)
    assert again.at - first.at == pytest.approx(8.0, abs=0.3)


def test_who_waits_too_far_from_its_goal_goes_on_when_there_is_room_nearer():
    world, _, _ = world_in(field())
    places = [
        (6.0 + radius * np.cos(turn), 7.0 + radius * np.sin(turn))
        for radius, count in ((0.35, 3), (0.75, 8), (1.2, 12), (1.65, 16))
        for turn in 2 * np.pi * np.arange(count) / count
    ]
    walker, *others = enter(world, (6.0, 1.0), *places)
    for agent, place in zip(others, places, strict=True):  # who faces a heading stays
        world.give(agent.agent_id, goal(*place, heading=0.0), 0.0)
    walked(world, 1.0)
    world.give(walker.agent_id, goal(6.0, 7.0), 1.0)
    tracks, arrived = walked(world, 10.0)
    assert walker.agent_id not in arrived and len(blocked(world)) == 1
    off = np.linalg.norm(np.array(places) - tracks[walker.agent_id][-1, :2], axis=1)
    for row in np.argsort(off)[:4].tolist():
        world.delete_agent(others[row].agent_id)
    tracks, arrived = walked(world, 16.0)
    assert arrived == {walker.agent_id}
    assert np.linalg.norm(tracks[walker.agent_id][-1, :2] - (6.0, 7.0)) < 2.0


@pytest.mark.parametrize(("beside", "settles"), [(0.3, False), (0.45, True)])
def test_nobody_settles_in_another_one(beside, settles):
    """The guards that close the way have a heading, so they stay; their numbers are higher."""
    world, _, _ = world_in(CORRIDOR)
    guards = [(x, 10.0 + beside) for x in (0.4, 1.0, 1.6)]
    walker, *others = enter(world, (1.0, 10.0), *guards)
    for agent, place in zip(others, guards, strict=True):
        world.give(agent.agent_id, goal(*place, heading=0.0), 0.0)
    world.give(walker.agent_id, goal(1.0, 10.9), 0.0)
    tracks, arrived = walked(world, 8.0)
    assert (walker.agent_id in arrived) == settles
    assert np.linalg.norm(tracks[walker.agent_id][:, :2] - (1.0, 10.0), axis=1).max() < 0.2


@pytest.mark.parametrize("asked", [(1.0, 11.0), (0.2, 10.0)])
def test_a_goal_stays_where_it_is_although_its_agent_stands_beside_others_at_a_wall(asked):
    """There it is nearer to the wall than a goal may be; a goal that is there is moved."""
    slots, start, goals, moved = Slots.empty(1), Motion.empty(1), GoalColumns.empty(1), []
    scenery = SimpleNamespace(scene=lambda number: CORRIDOR)
    tell, faults = (lambda *event: moved.append(event)), SimpleNamespace(any=False)
    planner = Planner(slots, Routes(slots), scenery, tell, tell, 1, faults)
    start.aims.asked[0], start.aims.spot[0] = asked, (0.2, 10.0)
    goals.position[0, :2] = start.aims.spot[0]
    planner.update(
        np.zeros(1, np.int64), np.array([[1.0, 9.0]]), start, goals, np.ones(1, np.bool_)
    )
    assert slots.route.passage[0] == Passage.OPEN
    assert bool(moved) == (asked == (0.2, 10.0))


def test_a_person_is_told_within_ten_seconds_without_progress_whatever_it_did_meanwhile():
    """It makes way twice, and goes .2 m on. Then it stands, and another event comes."""
    speeds = [0.0] * 10 + [-0.5] * 5 + [0.5] * 5 + [0.0] * 15 + [-0.5] * 5 + [0.5] * 7 + [0.0] * 45
    assert told_stuck(speeds) == pytest.approx([8.2, 17.4])


@pytest.mark.parametrize("came", [0.0, 0.2, 0.38])
@pytest.mark.parametrize("at", [1, 20, 37])
def test_a_person_that_advances_less_than_40_cm_in_ten_seconds_is_told_whenever_that_is(came, at):
    """It walks first. Small steps do not restart the ten seconds."""
    speeds = [1.0] * 20 + [0.0] * 50
    speeds[20 + at] = came / STEP_SECONDS
    first, *_ = told_stuck(speeds)
    assert 4.0 + 8.0 <= first <= 4.0 + 10.1


def test_a_person_that_comes_forward_slowly_is_not_told():
    assert told_stuck([0.21] * 500) == []
    assert told_stuck(([0.0] * 30 + [1.2] * 6) * 10) == []


@pytest.mark.parametrize("barred", [0.0, 3.4])
def test_an_agent_that_waits_too_far_from_its_goal_is_told_every_8_seconds(barred):
    """The event comes although the agent's way was closed before."""
    slots, people, told = Slots.empty(1), People.empty(1), []
    everybody = SimpleNamespace(people=people, slots=np.zeros(1, np.int64), stand=np.ones(1, bool))
    crowd = SimpleNamespace(session=lambda slot: everybody)
    avoidance = SimpleNamespace(crowd=crowd)
    company = Company(slots, None, None, avoidance, lambda *event: told.append(event))
    people.aims.barred[0] = barred
    for _ in range(50):  # 10 s: at the start, and again 8 s later
        company._wait(0, people.aims)
    assert [kind for _, kind, *_ in told] == [EventKind.BLOCKED] * 2
    people.aims.barred[0] = REPORT_S + STEP_SECONDS  # `BLOCKED` has said that its way is closed
    company._wait(0, people.aims)
    assert len(told) == 2


def told_stuck(speeds):
    """Seconds at which a person is stuck that moves along its way at `speeds`, one per step."""
    people, ahead, zero = People.empty(1), GoalColumns.empty(1), np.zeros(1, np.int64)
    crowd = SimpleNamespace(people=people, places=zero)
    company = Company(None, None, None, SimpleNamespace(crowd=crowd), None)
    hips, found = np.zeros((1, 2), np.float32), []
    for number, speed in enumerate(speeds, 1):
        ahead.position[0, :2] = hips[0] + np.array([0, 1])
        people.velocity[0] = 0, speed
        people.aims.stuck += np.float32(STEP_SECONDS)
        if company._count_progress(zero, hips, zero, people.aims, ahead)[0]:
            found.append(number * STEP_SECONDS)
        hips += np.float32(STEP_SECONDS) * people.velocity
    return found


def before_a_door(*people, width=0.9, length=0.8):
    """What people (place, goal, number) do before a door at the origin, in metres."""
    crowd = People.empty(len(people))
    crowd.position[:] = [place for place, _, _ in people]
    crowd.number[:] = [number for _, _, number in people]
    crowd.aims.spot[:] = [spot for _, spot, _ in people]
    crowd.walks[:] = crowd.aims.wants[:] = True
    ahead = [place[1] + np.sign(spot[1]) * np.arange(0.2, 4.01, 0.2) for place, spot, _ in people]
    points = np.stack([np.zeros((len(people), 20)), np.array(ahead)], -1)

    def distance(points):
        x, y = np.abs(points[..., 0]), np.abs(points[..., 1])
        return np.where(y < length / 2, width / 2 - x, 2.0)

    return turns(crowd, np.arange(len(people)), points, distance)


def waits_before_a_door(*people, **door):
    """Whether the first of them waits."""
    return bool(before_a_door(*people, **door).waits[0])


def test_at_a_door_each_waits_at_a_place_of_its_own_out_of_the_way():
    inside = ((0.0, 0.1), (0.0, -5.0), 9)
    mine = [((0.1 * k, -2.0 - 0.1 * k), (0.0, 5.0), k) for k in range(5)]
    turn = before_a_door(*mine, inside)
    assert turn.waits.tolist() == [True] * 5 + [False]
    assert (turn.place[:5, 0] > 0.8).all() and (turn.place[:5, 1] < -0.9).all()
    first = turn.place[0]
    later = before_a_door(((0.0, -2.0), (0.0, 5.0), 1), (first, (0.0, 5.0), 2), inside)
    assert later.there.tolist() == [False, True, False]
    assert np.linalg.norm(later.place[0] - first) > 0.6


def test_at_a_door_who_is_nearer_goes_first_and_others_of_its_way_follow():
    me, nearer = ((0.0, -2.0), (0.0, 5.0), 2), ((0.0, 1.5), (0.0, -5.0), 3)
    farther, inside = ((0.0, 2.3), (0.0, -5.0), 1), ((0.0, 0.1), (0.0, -5.0), 3)
    mine, gone = ((0.0, 0.1), (0.0, 5.0), 3), ((0.5, -1.3), (0.0, -5.0), 1)
    assert not waits_before_a_door(me)
    assert waits_before_a_door(me, nearer)
    assert not waits_before_a_door(me, farther)
    assert waits_before_a_door(me, inside)
    assert not waits_before_a_door(me, mine, nearer)
    assert not waits_before_a_door(me, gone)


@pytest.mark.parametrize(("width", "waits"), [(0.9, True), (1.5, True), (1.8, False)])
def test_a_door_of_1_5_m_is_passed_one_direction_at_a_time_and_a_wider_one_is_not(width, waits):
    me, nearer = ((0.0, -2.0), (0.0, 5.0), 2), ((0.0, 1.5), (0.0, -5.0), 3)
    assert waits_before_a_door(me, nearer, width=width) == waits


@pytest.mark.parametrize("away", [1.9, 2.3, 2.7, 3.1, 3.5])  # with other last bits
def test_two_pass_where_it_is_narrow_for_a_metre_from_wherever_they_come(away):
    me, nearer = ((0.0, -away), (0.0, 5.0), 2), ((0.0, 1.5), (0.0, -5.0), 3)
    assert waits_before_a_door(me, nearer, width=1.3, length=0.9)
    assert not waits_before_a_door(me, nearer, width=1.3, length=1.1)


def test_a_door_too_narrow_for_two_is_passed_both_ways():
    walls = (Box((2.3, 6.0), (4.6, 0.2), 3.0), Box((8.7, 6.0), (6.6, 0.2), 3.0))
    world, _, _ = world_in(field(*walls))
    south = [(4.0 + 0.8 * k, 4.0) for k in range(2)]
    north = [(4.0 + 0.8 * k, 8.0) for k in range(2)]
    people = enter(world, *south, *north)
    for agent, place in zip(people, (*north, *south), strict=True):
        world.give(agent.agent_id, goal(*place), 0.0)
    _, arrived = walked(world, 20.0)
    assert arrived == {agent.agent_id for agent in people}
