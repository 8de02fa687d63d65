"""Speed and smoothness of arrays whose right answers are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.errors import InvalidArgument
from wayfarer.spec import FPS
from wayfarer_lab.evaluation.metrics import kinematics

RANDOM = np.random.default_rng(0)


def polynomial(order: int, value: float, frames: int = 48) -> np.ndarray:
    """Three points whose derivative of `order` is `value` along X everywhere: [T, 3, 3]."""
    time = np.arange(frames) / FPS
    points = np.zeros((frames, 3, 3))
    points[..., 0] = (value * time**order / np.prod(np.arange(1, order + 1)))[:, None]
    return points


@given(value=st.floats(-5, 5))
def test_derivatives_are_exact_on_polynomials(value: float) -> None:
    assert kinematics.velocity(polynomial(1, value))[..., 0] == pytest.approx(value, abs=1e-9)
    assert kinematics.acceleration(polynomial(2, value)) == pytest.approx(abs(value), abs=1e-6)
    assert kinematics.jerk(polynomial(3, value)) == pytest.approx(abs(value), abs=1e-4)


def test_seam_ratio_is_one_without_seams_and_grows_with_a_spike_there() -> None:
    smooth = polynomial(2, 3.0)
    assert kinematics.seam_ratio(smooth) == pytest.approx(1.0)
    jump = smooth.copy()
    for seam in (8, 16, 24, 32, 40):
        jump[seam:, :, 1] += 0.01  # a step of 1 cm: two second differences of 0.01 · 40²
    assert kinematics.seam_ratio(jump) > 5
    assert kinematics.seam_ratio(jump, first_seam=4) < 0.5, "the spikes lie elsewhere now"


def test_seam_ratio_needs_frames_of_both_kinds() -> None:
    with pytest.raises(InvalidArgument, match="no seam"):
        kinematics.seam_ratio(polynomial(2, 1.0, frames=5), first_seam=7)


@given(speed=st.floats(0.0, 4.0), angle=st.floats(0.0, 6.28))
def test_travel_speed_ignores_height(speed: float, angle: float) -> None:
    time = np.arange(41) / FPS
    hips = np.stack(
        [speed * np.cos(angle) * time, speed * np.sin(angle) * time, np.sin(30 * time)], -1
    )
    assert kinematics.travel_speed(hips) == pytest.approx(speed, abs=1e-9)


def test_travel_speed_refuses_too_few_frames() -> None:
    with pytest.raises(InvalidArgument, match="11 frames"):
        kinematics.travel_speed(np.zeros((10, 3)))


def test_only_walking_windows_are_chosen() -> None:
    time = np.arange(40)[:, None] / FPS
    hips = np.stack([time * np.array([v, 0.0, 0.0]) for v in (0.5, 1.0, 1.3, 2.0)])
    assert kinematics.at_walking_speed(hips).tolist() == [False, True, True, False]


def test_deformation_is_the_spread_of_distances() -> None:
    points = np.zeros((4, 3, 3))
    points[:, 1, 0] = (1.0, 3.0, 1.0, 3.0)  # distances to the others: 1 or 3, σ = 1
    assert kinematics.deformation(points) == pytest.approx(2.0)
    moved = points + RANDOM.normal(size=(4, 1, 3))
    assert kinematics.deformation(moved) == pytest.approx(2.0), "a body may move as a whole"


def test_windows_are_whole_and_consecutive() -> None:
    track = np.arange(23)[:, None]
    assert kinematics.windows(track, 10)[..., 0].tolist() == [[*range(10)], [*range(10, 20)]]
    assert kinematics.windows(track, 24).shape == (0, 24, 1)
