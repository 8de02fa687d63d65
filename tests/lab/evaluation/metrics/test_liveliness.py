"""Statues and living people: motion by formula."""

import numpy as np
import pytest

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.metrics import liveliness

TIME = np.arange(20 * FPS) / FPS


def places(x: np.ndarray, joints: int = 1) -> np.ndarray:
    """Joints [T, J, 3] at x, all alike."""
    found = np.zeros((len(x), joints, 3))
    found[..., 0] = x[:, None]
    return found


def test_a_statue_is_still_and_a_person_is_not() -> None:
    assert liveliness.still_share(places(0 * TIME, 3)) == 1
    one = places(0 * TIME, 3)
    one[:, 1, 0] = 0.02 * TIME
    assert liveliness.still_share(one) == 0, "one joint lives"


def test_noise_of_a_frame_is_no_life() -> None:
    noise = 0.0002 * (-1.0) ** np.arange(len(TIME))
    assert liveliness.still_share(places(noise)) == 1


def test_speeds_and_sway_of_a_sine() -> None:
    sine = 0.02 * np.sin(2 * np.pi * TIME)
    assert liveliness.sway(places(sine)[:, 0]) == pytest.approx(0.02 / 2**0.5, rel=0.01)
    assert liveliness.median_speed(places(0.03 * TIME)) == pytest.approx(0.03)
    assert liveliness.sway(places(0 * TIME)[:, 0]) == 0


def test_slow_drift_hardly_counts_as_sway() -> None:
    drift = liveliness.sway(places(0.3 * TIME / TIME[-1])[:, 0])
    assert drift == pytest.approx(0.3 * 3 / 20 / 12**0.5, rel=0.05), "of 3 s, not of 20"


def test_a_glance_is_a_range_of_yaw_against_the_chest() -> None:
    degrees = 25 * np.sin(2 * np.pi * TIME / 3)
    radians = np.radians(degrees)
    head = np.zeros((len(TIME), 3, 3))
    head[:, 0, 0] = head[:, 1, 1] = np.cos(radians)
    head[:, 1, 0], head[:, 0, 1], head[:, 2, 2] = np.sin(radians), -np.sin(radians), 1
    chest = np.broadcast_to(np.eye(3), head.shape)
    yaw = liveliness.yaw_against(head, chest)
    assert yaw == pytest.approx(degrees, abs=1e-6)
    assert liveliness.range_in_window(yaw) == pytest.approx(50, rel=0.01)
    assert liveliness.range_in_window(liveliness.yaw_against(head, head)) == 0


def test_weight_shifts_from_foot_to_foot() -> None:
    ankles = np.zeros((len(TIME), 2, 3))
    ankles[:, 0, 0], ankles[:, 1, 0] = -0.1, 0.1
    hips = np.zeros((len(TIME), 3))
    hips[:, 0] = 0.06 * np.where((TIME // 5) % 2 == 0, -1, 1)  # every 5 s: 3 in 20 s
    assert liveliness.weight_shifts(hips, ankles) == pytest.approx(9)
    hips[:, 0] *= 0.2
    assert liveliness.weight_shifts(hips, ankles) == 0, "sway about the middle"
    assert np.isnan(liveliness.weight_shifts(hips, 0 * ankles))
