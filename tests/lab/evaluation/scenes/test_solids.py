"""Distances to solids, by hand and by sampling."""

import numpy as np
import pytest

from wayfarer.navigation.examples import PLATFORM, slope_with_steps, two_storeys
from wayfarer.navigation.scene import bake
from wayfarer.navigation.scene_spec import Box, Cylinder, Prism, Ramp
from wayfarer_lab.evaluation.scenes.solids import ground_height, signed_distance, standing

BOX = Box((1.0, 2.0), (2.0, 1.0), 0.4)


def at(solid, *point):
    return float(signed_distance(solid, np.array(point)))


def test_of_a_box_from_all_sides():
    assert at(BOX, 2.5, 2.0, 0.2) == pytest.approx(0.5)
    assert at(BOX, 1.0, 2.0, 0.2) == pytest.approx(-0.2), "the top is nearest"
    assert at(BOX, 1.95, 2.0, 0.2) == pytest.approx(-0.05)
    assert at(BOX, 1.0, 2.0, 0.7) == pytest.approx(0.3), "a hand above a low box is free"
    assert at(BOX, 2.3, 2.0, 0.8) == pytest.approx(0.5), "3, 4, 5 from the upper edge"


def test_a_turned_box_is_turned():
    turned = Box((0.0, 0.0), (2.0, 0.2), 1.0, yaw=np.pi / 2)
    assert at(turned, 0.0, 0.9, 0.5) < 0 < at(turned, 0.9, 0.0, 0.5)


def test_a_prism_is_what_the_same_box_is():
    prism = Prism(((0.0, 1.5), (2.0, 1.5), (2.0, 2.5), (0.0, 2.5)), 0.4)
    points = np.random.default_rng(0).uniform(-1, 4, (200, 3))
    assert signed_distance(prism, points) == pytest.approx(signed_distance(BOX, points))


def test_of_a_cylinder_and_of_a_lintel():
    assert at(Cylinder((0.0, 0.0), 1.0, 2.0), 1.5, 0.0, 1.0) == pytest.approx(0.5)
    lintel = Box((0.0, 0.0), (1.0, 1.0), 0.5, bottom=2.0)
    assert at(lintel, 0.0, 0.0, 1.8) == pytest.approx(0.2)


def test_of_a_ramp_above_and_below_its_slope():
    ramp = Ramp((0.0, 0.0), (2.0, 4.0), 3.0)  # 3, 4, 5
    assert at(ramp, 0.0, 0.0, 2.0) == pytest.approx(0.4)
    assert at(ramp, 0.0, 0.0, 1.0) == pytest.approx(-0.4)


def test_what_is_walked_on_is_told_from_what_is_in_the_way():
    scene = bake(slope_with_steps()).put("crate", Box((3.0, 3.0), (1.0, 1.0), 0.2))
    found = standing(scene)
    on_top = [s.solid for s in found if s.walked_on]
    assert sum(isinstance(solid, Ramp) for solid in on_top) == 1
    assert len(on_top) == 7, "slope, platform, five steps"
    assert not found[-1].walked_on, "an obstacle is never walked on, however low"


def test_ground_is_that_of_floor_slope_and_platform():
    scene = bake(slope_with_steps())
    points = np.array([[1.0, 1, 0], [10, 6, 0.6], [10, 11, 1.2], [10, 11, 0.2], [-5, 0, 0]])
    height = ground_height(scene, standing(scene), points)
    assert height[:3] == pytest.approx([0.0, PLATFORM / 2, PLATFORM])
    assert height[3] == 0.0, "the platform is more than a step above: one is inside of it"
    assert height[4] == -np.inf, "off the floor"


def test_a_gallery_is_no_ground_for_who_walks_below_it():
    scene = bake(two_storeys())
    points = np.array([[10.0, 4, 0], [10.0, 4, 3.0]])
    assert ground_height(scene, standing(scene), points).tolist() == [0.0, 3.0]
