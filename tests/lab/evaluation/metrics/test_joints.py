"""Knees, leans, pops and turns by known angles."""

import numpy as np
import pytest

from wayfarer.body.rotation import matrix_from_quaternion, quaternion_from_rotvec
from wayfarer.spec import FPS
from wayfarer_lab.evaluation.metrics import joints

SHINS = np.array([[0.01, -0.02, -0.45], [-0.01, -0.02, -0.45]])


def about(axis: int, degrees: np.ndarray | float) -> np.ndarray:
    turn = np.zeros((*np.shape(degrees), 3))
    turn[..., axis] = np.radians(degrees)
    return matrix_from_quaternion(quaternion_from_rotvec(turn))


@pytest.mark.parametrize("bent", [-30.0, -5.0, 0.0, 60.0, 150.0, 175.0])
def test_knees_bend_backward(bent: float) -> None:
    knees = np.tile(about(0, -bent), (3, 2, 1, 1))
    assert joints.knee_flexion(knees, SHINS) == pytest.approx(bent)


def test_a_knee_turned_inside_out_is_not_bent() -> None:
    knees = np.tile(about(0, -220.0), (1, 2, 1, 1))
    assert joints.knee_flexion(knees, SHINS) == pytest.approx(-140.0), "220° is beyond any knee"


def test_a_shin_that_turns_about_itself_does_not_bend() -> None:
    knees = np.tile(about(2, 40.0), (1, 2, 1, 1))
    assert np.abs(joints.knee_flexion(knees, SHINS)).max() < 2


def test_heads_look_up_and_down() -> None:
    assert joints.head_pitch(about(0, -20.0)) == pytest.approx(-20)
    assert joints.head_pitch(about(2, 90.0) @ about(0, 10.0)) == pytest.approx(10)


def test_the_whole_body_leans_to_any_side() -> None:
    ankles = np.array([[-0.1, 0, 0.08], [0.1, 0, 0.08]])
    for x, y in ((0.0, 1.0), (1.0, 0.0), (-0.6, 0.8)):
        head = np.array([np.sin(np.radians(20)) * x, np.sin(np.radians(20)) * y, 0])
        head[2] = 0.08 + np.cos(np.radians(20))
        assert joints.body_lean(ankles, head) == pytest.approx(20)


def test_a_pop_is_a_jump_of_velocity_and_a_walk_is_none() -> None:
    places = np.zeros((20, 3, 3))
    places[:, :, 1] = 0.03 * np.arange(20)[:, None]
    assert joints.pops(places).max() == pytest.approx(0, abs=1e-9), "an even way"
    places[10, 1, 2] += 0.05
    assert joints.pops(places).max() == pytest.approx(10.0), "up by 5 cm and down again"
    assert joints.pops(places).argmax() == 9, "inner frames count from 1"


def test_turning_rate_is_degrees_per_second() -> None:
    heading = 120.0 * np.arange(40) / FPS
    assert joints.turning_rate(heading)[5:-5] == pytest.approx(120.0)
    assert (joints.turning_rate(heading[:2]) == 0).all()


def test_a_turn_lasts_from_a_tenth_to_nine_tenths() -> None:
    turned = 90 * np.clip((np.arange(80) - 20) / 40, 0, 1)
    assert joints.turn_seconds(turned, 90.0) == pytest.approx(0.8, abs=1.5 / FPS)
    assert np.isnan(joints.turn_seconds(turned, 120.0)), "it never gets there"


def test_hands_are_ahead_of_the_hips_whichever_way_these_face() -> None:
    wrists = np.array([[0.2, 1.3, 1.0], [-0.2, 0.9, 0.8]])
    hips, faces = np.array([0.0, 1.0, 0.9]), np.array([0.0, 1.0])
    assert joints.hands_ahead(wrists, hips, faces) == pytest.approx([0.3, -0.1])
    assert joints.hands_ahead(wrists, hips, -faces) == pytest.approx([-0.3, 0.1])


def test_feet_apart_along_the_facing_only() -> None:
    ankles = np.array([[-0.1, 0.2, 0.08], [0.1, 0.0, 0.08]])
    assert joints.apart_along(ankles, np.array([0.0, 1.0])) == pytest.approx(0.2)
    assert joints.apart_along(ankles, np.array([1.0, 0.0])) == pytest.approx(0.2)
    assert joints.apart_along(ankles[::-1], np.array([0.0, -1.0])) == pytest.approx(0.2)
