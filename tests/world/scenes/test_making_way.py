"""People who stand in the way make way. The fake engine walks them."""

import numpy as np
import pytest

from tests.world.scenes.grounds import enter, field, world_in
from tests.world.scenes.test_company import CORRIDOR, blocked, on_floor
from tests.world.scenes.test_world_scenes import goal, walked
from wayfarer.world.avoidance.people import People
from wayfarer.world.scenes.asks import Asks, Neighbours, find_asks
from wayfarer.world.scenes.cells import cells_of
from wayfarer.world.scenes.making_way import (
    ASIDE,
    STEPS,
    Stepping,
    best_step,
    find_steps,
    find_stops,
    is_stopped,
)
from wayfarer.world.scenes.people import Gathering


@pytest.mark.parametrize("placed", [True, False])
@pytest.mark.parametrize("scene", [True, False])
def test_people_who_stand_in_the_way_step_aside_and_return(scene, placed):
    turn = 2 * np.pi * np.arange(12) / 12
    ring = [
        (6.0 + 1.35 * x, 8.0 + 1.35 * y) for x, y in zip(np.cos(turn), np.sin(turn), strict=True)
    ]
    if scene:
        world, _, _ = world_in(field())
        walker, *others = enter(world, (6.0, 3.0), *ring)
    else:
        world, (walker, *others) = on_floor((6.0, 3.0), *ring)
    for agent, (x, y) in zip(others, ring, strict=True):
        if placed:
            world.give(agent.agent_id, goal(x, y), 0.0)
    walked(world, 1.0)
    world.give(walker.agent_id, goal(6.0, 8.0), 1.0)
    tracks, arrived = walked(world, 16.0)
    assert arrived == {walker.agent_id}
    assert not blocked(world)
    off = [
        np.linalg.norm(tracks[agent.agent_id][:, :2] - place, axis=1)
        for agent, place in zip(others, ring, strict=True)
    ]
    assert 1 <= sum(each.max() > 0.5 for each in off) <= 4
    assert max(each[-1] for each in off) < 0.4


@pytest.mark.parametrize("scene", [True, False])
def test_of_two_who_stand_in_each_other_one_steps_aside_for_good(scene):
    places = [(6.0, 6.0), (6.3, 6.1), (6.0, 7.2)]
    if scene:
        world, _, _ = world_in(field())
        people = enter(world, *places)
    else:
        world, people = on_floor(*places)
    tracks, _ = walked(world, 10.0)
    tracks = [tracks[agent.agent_id][:, :2] for agent in people]
    count = min(map(len, tracks))
    one, other, third = (track[:count] for track in tracks)
    late = slice(count // 2, count)
    assert np.linalg.norm(one - places[0], axis=1).max() < 0.1
    assert np.linalg.norm(third - places[2], axis=1).max() < 0.1
    assert np.linalg.norm(other - one, axis=1)[late].min() > 0.5
    assert np.ptp(other[late], axis=0).max() < 0.1, "it stays there"


def test_of_two_who_wait_in_each_other_one_steps_out():
    world, _, _ = world_in(CORRIDOR)
    guards = [(0.4, 12.0), (1.0, 12.0), (1.6, 12.0)]
    one, other, *row = enter(world, (0.9, 10.7), (1.15, 10.7), *guards)
    for agent, place in zip(row, guards, strict=True):
        world.give(agent.agent_id, goal(*place, heading=0.0), 0.0)
    for agent in (one, other):
        world.give(agent.agent_id, goal(1.0, 15.0), 0.0)
    tracks, _ = walked(world, 8.0)
    one, other = (tracks[agent.agent_id][:, :2] for agent in (one, other))
    apart = np.linalg.norm(one - other, axis=1)
    assert apart[0] < 0.3
    assert apart[len(apart) // 2 :].min() > 0.38
    assert max(one[:, 1].max(), other[:, 1].max()) < 12, "they still wait"


def test_who_left_its_place_to_another_one_does_not_step_back_into_it_for_a_third():
    world, _, _ = world_in(CORRIDOR)
    guards = [(0.4, 12.0), (1.0, 12.0), (1.6, 12.0)]
    one, other, third, *row = enter(world, (0.4, 10.5), (0.65, 10.5), (1.0, 8.5), *guards)
    for agent, place in zip(row, guards, strict=True):
        world.give(agent.agent_id, goal(*place, heading=0.0), 0.0)
    world.give(third.agent_id, goal(1.0, 15.0), 1.0)
    tracks, _ = walked(world, 16.0)
    one, other, third = (tracks[agent.agent_id][:, :2] for agent in (one, other, third))
    count = min(map(len, (one, other, third)))
    late = slice(count // 3, count)
    assert np.linalg.norm(third[late] - (1.0, 15.0), axis=1).min() > 2, "nobody gets through"
    assert np.linalg.norm((one[:count] - other[:count])[late], axis=1).min() > 0.4


@pytest.mark.parametrize("heading", [None, 0.0])
def test_who_faces_a_heading_at_its_goal_does_not_make_way(heading):
    world, _, _ = world_in(CORRIDOR)
    places = [(0.4, 8.0), (1.0, 8.0), (1.6, 8.0)]
    walker, *others = enter(world, (1.0, 5.0), *places)
    for agent, place in zip(others, places, strict=True):
        world.give(agent.agent_id, goal(*place, heading=heading), 0.0)
    walked(world, 1.0)
    world.give(walker.agent_id, goal(1.0, 11.0), 1.0)
    tracks, arrived = walked(world, 13.0)
    off = [
        np.linalg.norm(tracks[agent.agent_id][:, :2] - place, axis=1).max()
        for agent, place in zip(others, places, strict=True)
    ]
    stays = heading is not None
    assert (walker.agent_id in arrived) != stays
    assert (max(off) < 0.1) == stays


@pytest.mark.parametrize("off", [1.4, 2.2])  # farther than an agent strays, and than it may stand
def test_an_agent_far_aside_returns_by_steps(off):
    world, _, _ = world_in(field())
    here, aside = np.array([6.0, 6.0]), np.array([0.0, off])
    agent, _ = enter(world, tuple(here), (9.0, 9.0))
    walked(world, 1.0)
    world.give(agent.agent_id, goal(*(here - aside)), 1.0)
    planned = world.slots.planned
    slot = int(np.linalg.norm(planned.seed.translation[:, -1, :2] - here, axis=-1).argmin())
    planned.gait.arrived[slot] = True
    planned.aims.spot[slot] = planned.aims.asked[slot] = here - aside
    planned.memory.yields[slot], planned.memory.retreat[slot] = 1.0, aside / 0.8
    walked(world, 2.0)
    assert not planned.aims.wants[slot]
    assert planned.memory.yields[slot] > 0
    walked(world, 8.0)
    assert planned.gait.arrived[slot]
    assert np.linalg.norm(planned.seed.translation[slot, -1, :2] - here + aside) < 0.4


def around(*others: dict) -> Neighbours:
    """Person 0 stands at (0, 0). The others come to it from the south, and ask, unless they say
    otherwise.
    """
    count, people = 1 + len(others), People.empty(1 + len(others))
    people.number[:] = np.arange(count)
    stand = np.arange(count) == 0
    first, last = np.zeros(count, np.int64), np.full(count, count)
    for row, given in enumerate(others, 1):
        people.position[row] = given.get("at", (0, -1))
        people.velocity[row] = given.get("velocity", (0, 0))
        people.height[row] = given.get("height", 0)
        people.walks[row] = given.get("walks", True)
        people.memory.waited[row] = given.get("waited", 3)
        people.memory.preferred[row] = given.get("preferred", (0, 1.2))
        people.aims.spot[row] = given.get("spot", (0, 9))
        if given.get("stranger"):
            first[row], last[:row] = row, row
    places, cells = np.arange(count), cells_of(first, people.position)
    return Neighbours.of(Gathering(people, places, (first, last), stand, places, cells))


def asked(them: Neighbours, aside: bool = False, stays: bool = True, home=(0, 0)) -> Asks:
    found = Asks.empty(1)
    flags = np.array([stays]), np.array([aside])
    places = np.zeros((1, 2), np.float32), np.array([home], np.float32)
    find_asks(them, np.zeros(1, np.int64), *places, *flags, found)
    return found


@pytest.mark.parametrize(
    ("others", "asks"),
    [
        ([{}], 1),
        ([{"at": (0, -2)}, {"at": (0, -1.5)}], 2),
        ([{"at": (0, -2.6)}], -1),  # it is far
        ([{"at": (0, 1)}], -1),  # it has passed
        ([{"at": (0.6, -1)}], -1),  # its way is free
        ([{"spot": (0, -0.5)}], -1),  # it stops before
        ([{"waited": 2}], -1),
        ([{"height": 3}], -1),
        ([{"stranger": True}], -1),
    ],
)
def test_it_is_the_nearest_whose_way_a_person_closes_that_asks_it(others, asks):
    found = asked(around(*others))
    assert found.asks[0] == asks and found.comes[0] == found.touches[0] == -1
    if asks >= 0:
        assert found.way[0].tolist() == [0, 1] and found.left[0] == 0


def test_a_person_aside_stays_there_for_everybody_that_comes():
    them = around({"waited": 2})
    found = asked(them, aside=True)
    assert found.comes[0] == 1 and found.asks[0] == -1
    assert asked(them).comes[0] == -1


def test_a_person_aside_is_asked_where_it_is_and_its_place_is_needed_where_that_is():
    them = around({})
    for home, comes in (((0, 0), 1), ((2, 0), -1)):
        found = asked(them, aside=True, home=home)
        assert found.asks[0] == 1 and found.comes[0] == comes and found.left[0] == 0


@pytest.mark.parametrize(
    ("others", "touches"),
    [
        ([{"at": (0.3, 0)}, {"at": (0, -0.2)}], 2),
        ([{"at": (0.42, 0)}], -1),
        ([{"at": (0.3, 0), "velocity": (0, 1)}], -1),
        ([{"at": (0.3, 0), "walks": False}], -1),  # two stand, and this one has the lower number
        ([{"at": (0.3, 0), "height": 3}], -1),
    ],
)
def test_it_steps_out_of_the_nearest_that_waits_in_its_place(others, touches):
    found = asked(them := around(*others))
    assert found.touches[0] == touches
    if touches >= 0:
        assert found.asks[0] == -1, "nobody is looked for that it would step aside for otherwise"
        x, y = them.people.position[touches]
        assert found.left[0] == pytest.approx(max(abs(x), abs(y)))
        assert found.way[0] == pytest.approx(np.array([-y, x]) / found.left[0])


def step(
    *others: np.ndarray, touches: bool = False, wall: float = np.inf, goal: float = 0.0
) -> np.ndarray | None:
    """The step of a person at (0, 0), .2 m left of a way along y. A wall is at x = -`wall`, and its
    goal is at (`goal`, 0).
    """
    asks, places = Asks.empty(1), np.empty((1, len(STEPS), 2))
    asks.touches[0], asks.way[0], asks.left[0] = 0 if touches else -1, (0, 1), 0.2
    row, here, at = np.zeros(1, np.int64), np.zeros(2, np.float32), np.array([goal, 0], np.float32)
    find_steps(Stepping(row, row, here[None], here[None], row > 0), asks, places)
    room = places[0, :, 0] + wall - 0.3
    found = best_step(here, at, asks, 0, places[0], room, np.array(others, np.float32))
    return None if found < 0 else places[0, found] / ASIDE


def test_a_step_leads_where_nobody_stops_it():
    zero, far = np.zeros(2, np.float32), np.array([-9.0, 0.0])
    first = step(far)
    assert first[0] < 0, "the person is to the left of the way, and steps to the left"
    second = step(far, 0.25 * first)
    assert second @ first < 0.75
    assert not is_stopped(zero, *second, np.float32(0.25 * first[None]))


def test_a_person_without_room_beside_the_way_steps_on_along_it():
    beside = [np.array([x, y]) for x in (-0.65, 0.5) for y in (-0.8, -0.4, 0.0, 0.4, 0.8)]
    assert step(*beside, (0.0, 1.6)) == pytest.approx((0, 1))
    assert step(*beside, (0.0, 1.1)) == pytest.approx((0, 0.6)), "as far as the way is free"
    assert step(*beside, (0.0, 0.7)) is None
    assert step(*beside, (0.0, 1.6), goal=1.99) is None


def test_a_step_leads_no_farther_from_the_goal_than_a_person_may_stand():
    far = np.array([-9.0, 0.0])
    assert step(far)[0] < 0
    assert step(far, goal=1.9)[0] > 0
    assert step(far, goal=2.9) is None


def test_of_places_without_room_a_person_that_touches_another_takes_the_roomiest():
    turn = 2 * np.pi * np.arange(12) / 12
    ring = 0.9 * np.stack([np.cos(turn), np.sin(turn)], 1)
    inside = np.array([0.1, 0.2])
    others = [inside, *ring]
    assert step(*others) is None
    found = 0.8 * step(*others, touches=True)
    room = np.linalg.norm(found - others, axis=1).min()
    assert np.linalg.norm(inside) + 0.05 < room < 0.46


def test_beside_a_wall_a_person_steps_along_it_out_of_another_one():
    other = np.array([0.2, 0.0])
    assert np.abs(step(other, touches=True, wall=0.3)) == pytest.approx((0, 1))


@pytest.mark.parametrize(
    ("other", "stopped"),
    [
        ((0.3, 0.2), True),
        ((0.3, 0.4), False),  # its way is free
        ((0.05, 0.2), False),  # it is beside
        ((-0.3, 0.0), False),  # it is behind
        ((-0.1, 0.3), False),  # the step leads out of it
        ((0.7, 0.2), True),  # far, but before the end
        ((1.3, 0.0), False),  # beyond the end
    ],
)
def test_people_that_stand_before_a_step_stop_it(other, stopped):
    zero, others = np.zeros(2, np.float32), np.array([other], np.float32)
    assert is_stopped(zero, 0.8, 0.0, others) == stopped
    assert not is_stopped(zero, 0.0, -0.8, others)


def test_those_near_a_person_or_its_place_are_seen_where_they_come_to_a_stand():
    far = {"at": (4, -2), "velocity": (0, 1)}
    them = around(far, {"at": (0.5, 0)}, {"at": (8, 0)}, {"at": (0, 0), "height": 3})
    zero, home = np.zeros(2, np.float32), np.array([4, -1], np.float32)
    others = find_stops(them, 0, zero, home)
    assert others.tolist() == [[4, pytest.approx(-1.65)], [0.5, 0]]
