"""Narrow ways: people that meet keep to the right, and turn their shoulders if necessary."""

import numpy as np
import pytest

from tests.world.scenes.grounds import enter, world_in
from tests.world.scenes.test_world_scenes import goal, walked
from wayfarer.navigation.scene import bake
from wayfarer.navigation.scene_spec import Floor, SceneSpec
from wayfarer.world.avoidance.people import People
from wayfarer.world.scenes.lanes import LANE, LANES, TURN, Lane, lanes

BEFORE = np.array([0.1, 0.4, 0.7, 1.0])


def lane_in(width: float, *others: tuple[float, float, float]) -> Lane:
    """The lane of a person in the middle of a corridor. `others`: x, y and their speed upward."""
    people = People.empty(1 + len(others))
    people.walks[:] = True
    people.position[:] = [(0, 0), *((x, y) for x, y, _ in others)]
    people.velocity[:, 1] = people.memory.preferred[:, 1] = [1.2, *(up for *_, up in others)]
    points = np.stack([np.zeros(4), BEFORE], -1)[None]
    return lanes(people, np.array([0]), points, lambda p: width / 2 - np.abs(p[..., 0]))


@pytest.mark.parametrize("width", [0.4, 0.95, 1.5])
def test_half_of_a_ways_width_is_measured_wherever_it_runs(width):
    measured = lane_in(width).width
    assert measured.most == pytest.approx(width / 2) == measured.least


@pytest.mark.parametrize(
    ("width", "others", "keeps"),
    [
        (1.2, [(0.1, 4.0, -1.2)], True),
        (1.2, [(0.1, 4.0, 1.2)], False),  # it goes the same way
        (1.2, [(0.1, -1.0, -1.2)], False),  # it has passed
        (1.2, [(0.1, 9.0, -1.2)], False),  # it is far
        (4.0, [(0.1, 4.0, -1.2)], False),  # there is room enough
        (1.2, [], False),
    ],
)
def test_before_who_comes_the_other_way_one_keeps_to_the_right_in_a_narrow_way(
    width, others, keeps
):
    lane = lane_in(width, *others)
    assert lane.keeps[0] == keeps
    if keeps:
        assert lane.place[0, 0] > LANE * width / 2  # the more, as it is not there yet


def test_a_door_is_seen_but_has_no_lanes():
    """People that come through in both directions would stop in them."""
    people = People.empty(2)
    people.walks[:] = True
    people.position[1] = 0.1, 3.0
    people.velocity[:, 1] = people.memory.preferred[:, 1] = 1.2, -1.2
    points = np.stack([np.zeros(4), BEFORE], -1)[None]
    lane = lanes(
        people,
        np.array([0]),
        points,
        lambda p: np.where(np.abs(p[..., 1] - 0.4) < 0.2, 0.6, 2.0) - np.abs(p[..., 0]),
    )
    assert not lane.keeps[0] and lane.turn[0] == 0 and lane.width.most[0] > 0.9
    assert lane.width.least[0] == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("far", "is_door"), [(0.25, True), (0.4, True), (0.55, True), (5.0, False)]
)
def test_a_door_in_a_thin_wall_is_seen_and_a_wall_before_which_a_way_ends_is_none(far, is_door):
    """A wall of .2 m with a door of .9 m, and a room of 4 m that ends .5 m behind the way's end."""

    def distance(places):
        beside, wall = np.abs(places[..., 0]) - 0.45, np.abs(places[..., 1] - far) - 0.1
        outside = np.hypot(np.maximum(-beside, 0), np.maximum(wall, 0))
        in_wall = np.where((beside > 0) & (wall < 0), np.maximum(-beside, wall), outside)
        sides = np.minimum(2.0 - np.abs(places[..., 0]), 1.5 - places[..., 1])
        return np.minimum(in_wall, sides)

    people = People.empty(1)
    points = np.stack([np.zeros(4), BEFORE], -1)[None]
    lane = lanes(people, np.array([0]), points, distance)
    half = lane.width.least[0]
    assert half == pytest.approx(0.45, abs=0.15) if is_door else half > LANES


def test_shoulders_are_turned_where_two_pass_and_where_one_hardly_fits():
    comes = (-0.1, 1.5, -1.2)
    assert lane_in(0.95, comes).turn == pytest.approx(TURN, rel=0.1)
    assert 0 < lane_in(1.2, comes).turn < TURN / 2
    assert lane_in(1.55, comes).turn == 0
    assert lane_in(0.95, (-0.1, 5.0, -1.2)).turn == 0  # not yet
    assert lane_in(0.95).turn == 0
    assert lane_in(0.4).turn == pytest.approx(TURN)


@pytest.mark.parametrize("width", [0.95, 1.2, 1.55])
def test_two_who_meet_in_a_corridor_pass_without_a_stop(width):
    x, y = width / 2, 6.0
    floor = Floor(((-x, -y), (x, -y), (x, y), (-x, y)))
    world, _, _ = world_in(bake(SceneSpec(floors=(floor,))))
    one, other = enter(world, (0.05, -3.5), (0.0, 3.5))
    world.give(one.agent_id, goal(0.0, 3.5), 0.0)
    world.give(other.agent_id, goal(0.0, -3.5), 0.0)
    tracks, arrived = walked(world, 10.0)
    assert arrived == {one.agent_id, other.agent_id}
    a, b = (track[:, :2] for track in tracks.values())
    count = min(len(a), len(b))
    assert np.linalg.norm(a[:count] - b[:count], axis=1).min() > 0.3
