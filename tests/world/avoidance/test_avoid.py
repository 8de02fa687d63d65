"""People avoid each other: simulated as points with the inertia of bodies (walkers.py)."""

import numpy as np
import pytest

from tests.world.avoidance.walkers import Walkers
from wayfarer.world.avoidance.avoid import avoid
from wayfarer.world.avoidance.kernel import HEADWAY, HEADWAY_AT_DOORS, Width
from wayfarer.world.avoidance.people import People

TOUCH = 0.45
"""Distance in metres below which two bodies overlap."""


def to(goals):
    places = np.array(goals, np.float32)
    return lambda walkers: places


def until_there(walkers, most):
    while walkers.now < most and not walkers.there.all():
        walkers.run(1.0)
    return walkers


def too_near(walkers):
    """Share of overlapping people, over all people and times."""
    return float((np.array(walkers.nearest) < TOUCH).mean())


def least(walkers):
    return float(np.array(walkers.nearest).min())


def standing_at(*places, radius=0.25):
    people = People.empty(len(places))
    people.number[:] = np.arange(len(places))
    people.position[:] = places
    people.radius[:] = radius
    return people


def velocity(people, preferred, clear=None):
    """Velocity of person 0."""
    course = avoid(people, np.array([0]), np.array([preferred], np.float32), clear, 0.2)
    return course.velocity[0], bool(course.waits[0])


def test_alone_one_goes_where_one_would():
    people = standing_at((0.0, 0.0), (50.0, 0.0))
    chosen, waits = velocity(people, (0.0, 1.2))
    assert np.allclose(chosen, (0.0, 1.2), atol=1e-3) and not waits


def test_at_a_door_people_follow_more_closely():
    people = standing_at((0.0, 0.0), (0.0, 0.7))
    people.walks[:], people.velocity[:] = True, (0.0, 0.9)
    people.memory.preferred[:] = 0.0, 1.2

    def corridor(places):
        return 0.26 - np.abs(places[..., 0])

    paces = []
    for least in (2.0, 0.45):
        width = Width(np.full(1, 2.0, np.float32), np.full(1, least, np.float32))
        preferred = np.array([(0.0, 1.2)], np.float32)
        course = avoid(people, np.array([0]), preferred, corridor, 0.2, width=width)
        assert course.velocity[0, 0] == 0  # it stays behind the other one
        paces.append(float(course.velocity[0, 1]))
    assert paces[1] == pytest.approx(paces[0] * HEADWAY / HEADWAY_AT_DOORS, rel=1e-5)
    assert paces[1] < 1.2


def test_a_standing_person_is_walked_around():
    people = standing_at((0.0, 0.0), (0.0, 2.0))
    people.velocity[0] = 0.0, 1.2
    chosen, _ = velocity(people, (0.0, 1.2))
    assert abs(chosen[0]) > 0.2 and chosen[1] > 0.5


def test_nobody_meets_people_of_another_storey():
    people = standing_at((0.0, 0.0), (0.0, 2.0), (0.1, 6.0))
    people.velocity[:] = (0.0, 1.2), (0.0, -1.2), (0.0, -1.2)
    people.memory.preferred[:] = people.velocity
    people.walks[:] = True
    people.height[:] = 0.9, 3.5, -1.7
    chosen, _ = velocity(people, (0.0, 1.2))
    assert np.allclose(chosen, (0.0, 1.2), atol=1e-3)
    people.height[1] = 1.7  # some steps up
    chosen, _ = velocity(people, (0.0, 1.2))
    assert chosen[0] > 0.2


def test_who_comes_towards_one_is_passed_on_the_right():
    people = standing_at((0.0, 0.0), (0.0, 5.0))
    people.walks[:] = True
    people.velocity[:] = people.memory.preferred[:] = (0.0, 1.2), (0.0, -1.2)
    chosen, _ = velocity(people, (0.0, 1.2))
    assert chosen[0] > 0.1


def oncoming(*places):
    """Person 0 at the origin, and people at `places` that would walk towards -y."""
    people = standing_at((0.0, 0.0), *places)
    people.walks[:] = True
    people.velocity[0] = 0.0, 1.2
    people.memory.preferred[:] = [(0.0, 1.2)] + [(0.0, -1.2)] * len(places)
    return people


def test_a_stream_is_passed_on_the_right_even_if_it_is_there_and_one_person_is_not():
    stream = oncoming((1.3, 5.0), (1.4, 6.0), (1.3, 7.0), (1.4, 8.0))
    chosen, _ = velocity(stream, (0.0, 1.2))
    assert chosen[0] > 0.2
    chosen, _ = velocity(oncoming((1.3, 5.0)), (0.0, 1.2))
    assert np.allclose(chosen, (0.0, 1.2), atol=1e-3)


def test_an_oncoming_stream_is_seen_behind_ones_own():
    own = [(x, y) for x in (-0.6, 0.0, 0.6) for y in (1.0, 2.0, 3.0, 4.0)]
    people = oncoming(*own, (0.0, 8.0), (0.2, 9.0))
    people.memory.preferred[1:-2] = people.velocity[:-2] = 0.0, 1.2
    chosen, _ = velocity(people, (0.0, 1.2))
    assert chosen[0] > 0.1


@pytest.mark.parametrize("oncoming", [True, False])
def test_way_is_made_for_who_comes_towards_one_and_not_for_who_walks_behind(oncoming):
    people = standing_at((0.0, 1.0), (0.0, 0.0))
    people.number[:] = 2, 1
    people.walks[:] = True
    people.memory.waited[:] = 5.0
    people.memory.preferred[:] = 0.0, 1.2
    mine = (0.0, -1.2 if oncoming else 1.2)
    course = avoid(people, np.array([0]), np.array([mine], np.float32), None, 0.2)
    assert (course.memory.yields[0] > 0) == oncoming


def test_a_wall_is_not_walked_into():
    people = standing_at((0.0, 0.0), (50.0, 0.0))
    people.velocity[0] = 0.0, 1.2
    chosen, _ = velocity(people, (0.0, 1.2), lambda points: 1.0 - points[..., 1])
    assert chosen[1] < 0.8


def test_nobody_is_told_to_creep():
    generator = np.random.default_rng(0)
    people = standing_at(*generator.uniform(-4, 4, (60, 2)))
    people.walks[:] = True
    people.velocity[:] = generator.normal(0, 0.7, (60, 2))
    preferred = np.full((60, 2), 0.9, np.float32)
    course = avoid(people, np.arange(60), preferred, None, 0.2)
    speed = np.linalg.norm(course.velocity, axis=-1)
    assert (course.waits == (speed == 0)).all()
    assert (speed[speed > 0] >= 0.499).all()


def test_a_row_depends_on_the_people_and_not_on_who_else_is_asked():
    generator = np.random.default_rng(1)
    people = standing_at(*generator.uniform(-5, 5, (40, 2)))
    people.walks[:] = generator.random(40) < 0.8
    people.velocity[:] = generator.normal(0, 0.7, (40, 2))
    people.memory.waited[:] = generator.uniform(0, 4, 40)
    people.memory.preferred[:] = generator.normal(0, 1, (40, 2))
    preferred = generator.normal(0, 1, (40, 2)).astype(np.float32)

    def clear(points):
        return 4.0 - np.abs(points).max(-1)

    together = avoid(people, np.arange(40), preferred, clear, 0.2)
    for rows in (np.array([7]), np.array([3, 7, 31]), np.arange(39, -1, -1)):
        some = avoid(people, rows, preferred[rows], clear, 0.2)
        assert (some.velocity == together.velocity[rows]).all()
        assert (some.memory.retreat == together.memory.retreat[rows]).all()
        assert (some.memory.yields == together.memory.yields[rows]).all()


def test_those_of_another_session_are_not_seen():
    generator = np.random.default_rng(2)
    people = standing_at(*generator.uniform(-2, 2, (20, 2)))
    people.velocity[:] = people.memory.preferred[:] = generator.normal(0, 1, (20, 2))
    people.walks[:], people.group[::2] = True, 1
    preferred = people.memory.preferred + np.float32(0.1)
    first, last = np.repeat([0, 8], [8, 12]), np.repeat([8, 20], [8, 12])
    both = avoid(people, np.arange(20), preferred, None, 0.2, own=(first, last))
    for rows in (np.arange(8), np.arange(8, 20)):
        alone = avoid(people.take(rows), np.arange(len(rows)), preferred[rows], None, 0.2)
        np.testing.assert_array_equal(both.velocity[rows], alone.velocity)
    assert (both.velocity != avoid(people, np.arange(20), preferred, None, 0.2).velocity).any()


def test_two_head_on_pass():
    walkers = until_there(Walkers(np.array([[0, 0], [0, 10.0]]), to([(0, 10), (0, 0)])), 20)
    assert walkers.there.all() and least(walkers) > 0.55


def test_four_cross():
    starts = np.array([[0, 0], [5, 5], [-5, 5], [0, 10.0]])
    walkers = until_there(Walkers(starts, to([(0, 10), (-5, 5), (5, 5), (0, 0)])), 25)
    assert walkers.there.all() and least(walkers) > TOUCH


def test_a_circle_swaps():
    turn = np.arange(24) * np.pi / 12
    starts = 8.0 * np.stack([np.cos(turn), np.sin(turn)], -1)
    walkers = until_there(Walkers(starts, to(-starts)), 60)
    assert walkers.there.all() and least(walkers) > 0.4
    assert too_near(walkers) < 0.002 and walkers.stuck.max() < 10


def test_a_corridor_with_twenty_against_twenty_clears():
    k, shake = np.arange(20), np.random.default_rng(0).uniform(-0.1, 0.1, (2, 20))
    side = np.where(k % 2, 0.5, -0.5)
    west = np.stack([1 - k // 2 * 1.2, side + shake[0]], -1)
    east = np.stack([23 + k // 2 * 1.2, side + shake[1]], -1)
    goals = np.concatenate([west + np.array([1000, 0]), east - np.array([1000, 0])])
    walkers = Walkers(
        np.concatenate([west, east]), to(goals), clear=lambda p: 1.25 - np.abs(p[..., 1])
    )

    def is_clear():
        x = walkers.people.position[:, 0]
        return (x[:20] > 23).all() and (x[20:] < 1).all()

    while walkers.now < 100 and not is_clear():
        walkers.run(2.0)
    assert is_clear()
    assert too_near(walkers) < 0.02 and walkers.stuck.max() < 10


@pytest.mark.parametrize("seed", range(3))
def test_a_jam_in_a_corridor_dissolves(seed):
    """People of both directions stand mixed, as after two streams have met."""
    random = np.random.default_rng(seed)
    place = np.stack(np.meshgrid(np.arange(6) * 0.8, (-0.8, 0.0, 0.8)), -1).reshape(-1, 2)
    ahead = np.where(random.permutation(18) < 9, 1.0, -1.0)
    goals = place + np.stack([1000 * ahead, np.zeros(18)], -1)
    walkers = Walkers(
        place + random.uniform(-0.05, 0.05, (18, 2)),
        to(goals),
        clear=lambda p: 1.25 - np.abs(p[..., 1]),
    )

    def is_clear():
        x = walkers.people.position[:, 0]
        return x[ahead > 0].min() > x[ahead < 0].max()

    while walkers.now < 60 and not is_clear():
        walkers.run(1.0)
    assert is_clear()
    assert too_near(walkers) < 0.03


def doorway(points):
    """A wall along x = 0, 16 cm thick, with a door of 1 m."""
    x, y = np.abs(points[..., 0]), np.abs(points[..., 1])
    beside = np.hypot(np.maximum(x - 0.08, 0), np.maximum(0.5 - y, 0))
    return np.where(y > 0.5, x - 0.08, beside)


def test_a_doorway_is_shared():
    y = np.arange(5) - 2.0
    west, east = np.stack([np.full(5, -4.0), y], -1), np.stack([np.full(5, 4.0), y], -1)
    goals, side = np.concatenate([east, west]), np.repeat([1.0, -1.0], 5)

    def through(walkers):
        place = walkers.people.position
        inside = np.abs(place[:, 1]) < 0.25
        door = np.stack([np.where(inside, 0.6 * side, 0.0), np.zeros(10)], -1)
        return np.where((place[:, 0] * side < 0.3)[:, None], door, goals)

    walkers = until_there(Walkers(np.concatenate([west, east]), through, clear=doorway), 90)
    assert walkers.there.all()
    assert too_near(walkers) < 0.02 and walkers.stuck.max() < 20


def test_a_busy_room_keeps_moving():
    generator = np.random.default_rng(2)
    side, count = 14.0, 60
    grid = np.stack(np.meshgrid(*[np.linspace(-6, 6, 8)] * 2), -1).reshape(-1, 2)[:count]
    goals = generator.uniform(-6, 6, (count, 2)).astype(np.float32)
    changed = np.zeros(count)

    def wander(walkers):
        near = np.linalg.norm(goals - walkers.people.position, axis=-1) < 0.8
        late = walkers.now - changed > 15
        goals[near | late] = generator.uniform(-6, 6, (int((near | late).sum()), 2))
        changed[near | late] = walkers.now
        return goals

    speed = generator.uniform(0.9, 1.4, count)
    walkers = Walkers(grid, wander, clear=lambda p: side / 2 - np.abs(p).max(-1), speed=speed).run(
        30.0
    )
    assert too_near(walkers) < 0.013 and walkers.stuck.max() < 10


@pytest.mark.parametrize("grouped", [True, False])
def test_a_group_is_no_stranger(grouped):
    people = standing_at((0.0, 0.0), (0.62, 1.5))
    people.walks[:] = True
    people.velocity[:] = (0.0, 1.2), (0.0, 0.6)
    people.group[:] = 1 if grouped else 0
    chosen, _ = velocity(people, (0.0, 1.2))
    straight = np.allclose(chosen, (0.0, 1.2), atol=0.02)
    assert straight == grouped


def test_who_is_before_its_group_slows_down():
    people = standing_at((0.0, 6.0), (0.0, 1.0))
    people.group[:] = 1
    chosen, _ = velocity(people, (0.0, 1.2))
    assert 0.6 < chosen[1] < 1.1
