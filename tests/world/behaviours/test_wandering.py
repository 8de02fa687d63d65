from itertools import pairwise
from math import dist

import numpy as np
import pytest

from wayfarer.world.behaviours import Wander
from wayfarer.world.behaviours.wander import APART, wander_goal

AREA = Wander((10.0, -4.0), 6.0, speed=0.8, dwell=3.0)


def places(area, seed=1, revision=1, count=200):
    found = [(0.0, 0.0)]
    for waypoint in range(count):
        found.append(wander_goal(area, seed, revision, waypoint, found[-1]).position[:2])
    return found


def test_places_fill_the_area_and_lie_apart():
    found = places(AREA, count=2000)
    assert all(dist(place, AREA.center) <= AREA.radius + 1e-9 for place in found[1:])
    assert all(dist(a, b) >= APART for a, b in pairwise(found))
    away = np.array([dist(place, AREA.center) for place in found[1:]])
    assert (away < AREA.radius / np.sqrt(2)).mean() == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("radius", [0.5, 0.6, 0.8])
def test_in_a_small_area_it_goes_as_far_as_it_can(radius):
    area = Wander((3.0, 3.0), radius)
    for a, b in pairwise(places(area)[1:]):
        assert dist(a, b) >= min(APART, radius + dist(a, area.center)) - 1e-9
        assert dist(b, area.center) <= radius + 1e-9


def test_from_the_very_centre_it_goes_somewhere():
    goal = wander_goal(Wander((3.0, 3.0), 0.5), 1, 1, 0, (3.0, 3.0))
    assert dist(goal.position[:2], (3.0, 3.0)) <= 0.5 + 1e-9


def test_a_place_depends_on_seed_revision_and_number_alone():
    def place(seed=1, revision=2, waypoint=3):
        return wander_goal(AREA, seed, revision, waypoint, (0.0, 0.0)).position

    assert place() == place() == place(seed=1)
    others = {place(seed=2), place(revision=3), place(waypoint=4), place(seed=2**64 - 1)}
    assert len(others) == 4 and place() not in others


def test_goals_carry_speed_and_dwell():
    goal = wander_goal(AREA, 1, 1, 0, (0.0, 0.0))
    assert (goal.speed, goal.dwell, goal.stop, goal.position[2]) == (0.8, 3.0, True, 0.0)
