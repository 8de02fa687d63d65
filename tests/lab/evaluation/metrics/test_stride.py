"""A walk whose steps, swings and speed are known."""

import numpy as np
import pytest

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.metrics import stride

SECONDS, SPEED, STEP = 6.0, 1.2, 0.5  # a step each half second: 120 a minute, 0.6 m long
TIME = np.arange(round(SECONDS * FPS)) / FPS


def walker(angle: float = 0.0, width: float = 0.12, limp: float = 0.0) -> tuple[np.ndarray, ...]:
    """Ankles [T, 2, 3] and hips [T, 3] on a way `angle` radians to the left of +Y; `limp` metres
    by which the left foot reaches farther.
    """
    hips = np.zeros((len(TIME), 3))
    hips[:, 1], hips[:, 2] = SPEED * TIME, 0.9
    ankles = np.zeros((len(TIME), 2, 3))
    for foot, (side, start) in enumerate(((-1, 0.0), (1, 0.5))):
        swing = np.cos(2 * np.pi * (TIME / (2 * STEP) - start))
        ankles[:, foot, 0] = side * width / 2
        ankles[:, foot, 1] = hips[:, 1] + (0.3 + (limp if foot == 0 else 0)) * swing
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for places in (ankles, hips):
        places[..., :2] = places[..., :2] @ turn.T
    return ankles, hips


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5, -2.0])
def test_steps_of_a_walk_in_any_direction(angle: float) -> None:
    steps = stride.steps(*walker(angle))
    assert steps is not None
    assert steps.cadence == pytest.approx(120, rel=0.02)
    assert steps.length.mean() == pytest.approx(SPEED * STEP, rel=0.02)
    assert steps.width.mean() == pytest.approx(0.12, abs=0.002)
    assert (np.diff(steps.feet) != 0).all(), "left and right in turn"
    assert steps.stride_frames == pytest.approx(2 * STEP * FPS, abs=1)


def test_feet_that_cross_have_a_negative_width() -> None:
    steps = stride.steps(*walker(width=-0.05))
    assert steps is not None and steps.width.mean() == pytest.approx(-0.05, abs=0.002)


def test_a_limp_shows_in_the_steps_of_one_foot() -> None:
    steps = stride.steps(*walker(limp=0.1))
    assert steps is not None
    left, right = (steps.length[steps.feet[1:] == foot].mean() for foot in (0, 1))
    assert left - right == pytest.approx(0.2, abs=0.01)


def test_who_stands_or_glides_takes_no_steps() -> None:
    ankles, hips = walker()
    glided = np.repeat(hips[:, None], 2, 1)
    assert stride.steps(glided, hips) is None
    assert stride.steps(ankles[:30], hips[:30]) is None, "one step is no walk"


def test_oscillation_is_the_range_of_a_sine_without_drift() -> None:
    swing = 0.02 * np.sin(2 * np.pi * TIME * 2)
    assert stride.oscillation(swing, FPS) == pytest.approx(0.04, rel=0.02)
    assert stride.oscillation(swing + 0.1 * TIME, FPS) == pytest.approx(0.04, rel=0.02)
    assert stride.oscillation(0.1 * TIME, FPS) == pytest.approx(0, abs=1e-3)
    assert np.isnan(stride.oscillation(swing[: FPS + 5], FPS))


def test_extremes_are_of_each_stride() -> None:
    angles = 40 + 30 * np.sin(2 * np.pi * TIME)
    strikes = np.arange(0, len(TIME), FPS)
    assert stride.extremes(angles, strikes) == pytest.approx((10, 70), abs=0.5)
    once = angles.copy()
    once[10] = 170
    assert stride.extremes(once, strikes)[1] == pytest.approx(70 + 100 / 5, abs=1), "of five"
    assert np.isnan(stride.extremes(angles, strikes[:1])).all()


def test_arms_swing_along_the_way() -> None:
    shoulder = np.zeros((1, 3))
    for degrees in (-30.0, 0.0, 45.0):
        ahead, down = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
        wrist = np.array([[0.0, ahead, -down]])
        assert stride.swing(shoulder, wrist, np.array([0.0, 1.0])) == pytest.approx(degrees)
        assert stride.swing(shoulder, wrist, np.array([1.0, 0.0])) == pytest.approx(0)


def test_phase_runs_from_strike_to_strike() -> None:
    phase = stride.phase(np.array([10, 30, 70]), 80)
    assert np.isnan(phase[:10]).all() and np.isnan(phase[70:]).all()
    assert phase[10] == 0 and phase[20] == 0.5 and phase[50] == 0.5
