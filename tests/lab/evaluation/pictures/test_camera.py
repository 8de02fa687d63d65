from math import pi, radians

import numpy as np
import pytest

from wayfarer_lab.evaluation.pictures.camera import Camera, View


def test_the_target_is_in_the_middle_at_its_distance_and_to_scale():
    view = View(azimuth=0.7, elevation=0.3, distance=5.0, metres=2.0, size=(400, 200))
    camera = Camera(view, (1.0, 2.0, 0.9))
    np.testing.assert_allclose(camera.project(np.array([1.0, 2.0, 0.9])), [200, 100, 5.0])
    aside = np.array([1.0, 2.0, 0.9]) + 0.5 * view.axes[0]
    np.testing.assert_allclose(camera.project(aside), [250, 100, 5.0])  # 2 m are 200 pixels


@pytest.mark.parametrize(("azimuth", "point"), [(0, [1, 9, 0]), (pi / 2, [-9, 1, 0])])
def test_azimuth_0_looks_along_y_and_turns_to_the_left(azimuth, point):
    camera = Camera(View(azimuth, 0.0, 3.0, 2.0, (100, 100)), (0.0, 0.0, 0.0))
    column, row, depth = camera.project(np.array(point, float))
    assert depth == pytest.approx(12)
    assert column > 50 and row == pytest.approx(50)


def test_from_above_what_is_far_is_higher_in_the_picture_and_up_is_up():
    camera = Camera(View(0.0, radians(30), 5.0, 2.0, (100, 100)), (0.0, 0.0, 0.0))
    near, far, high = camera.project(np.array([[0, -1, 0], [0, 1, 0], [0, 0, 0.5]], float))
    assert near[1] > 50 > far[1] and high[1] < 50
    assert camera.position[2] == pytest.approx(2.5)


def test_a_wide_view_opens_by_its_angle():
    view = View.wide(0.0, 0.0, 4.0, radians(90), (100, 50))
    assert view.metres == pytest.approx(8.0)
