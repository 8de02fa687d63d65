"""Speed, smoothness and model errors on arrays whose right answers are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.errors import InvalidArgument
from wayfarer.spec import FPS
from wayfarer_lab.evaluation import metrics

RANDOM = np.random.default_rng(0)


def polynomial(order: int, value: float, frames: int = 48) -> np.ndarray:
    """Three points whose derivative of `order` is `value` along X everywhere: [T, 3, 3]."""
    time = np.arange(frames) / FPS
    points = np.zeros((frames, 3, 3))
    points[..., 0] = (value * time**order / np.prod(np.arange(1, order + 1)))[:, None]
    return points


@given(value=st.floats(-5, 5))
def test_derivatives_are_exact_on_polynomials(value: float) -> None:
    assert metrics.velocity(polynomial(1, value))[..., 0] == pytest.approx(value, abs=1e-9)
    assert metrics.acceleration(polynomial(2, value)) == pytest.approx(abs(value), abs=1e-6)
    assert metrics.jerk(polynomial(3, value)) == pytest.approx(abs(value), abs=1e-4)


def test_seam_ratio_is_one_without_seams_and_grows_with_a_spike_there() -> None:
    smooth = polynomial(2, 3.0)
    assert metrics.seam_ratio(smooth) == pytest.approx(1.0)
    jump = smooth.copy()
    for seam in (8, 16, 24, 32, 40):
        jump[seam:, :, 1] += 0.01  # a step of 1 cm: two second differences of 0.01 · 40²
    assert metrics.seam_ratio(jump) > 5
    assert metrics.seam_ratio(jump, first_seam=4) < 0.5, "the spikes lie elsewhere now"


def test_seam_ratio_needs_frames_of_both_kinds() -> None:
    with pytest.raises(InvalidArgument, match="no seam"):
        metrics.seam_ratio(polynomial(2, 1.0, frames=5), first_seam=7)


@given(speed=st.floats(0.0, 4.0), angle=st.floats(0.0, 6.28))
def test_travel_speed_ignores_height(speed: float, angle: float) -> None:
    time = np.arange(41) / FPS
    hips = np.stack(
        [speed * np.cos(angle) * time, speed * np.sin(angle) * time, np.sin(30 * time)], -1
    )
    assert metrics.travel_speed(hips) == pytest.approx(speed, abs=1e-9)


def test_travel_speed_refuses_too_few_frames() -> None:
    with pytest.raises(InvalidArgument, match="11 frames"):
        metrics.travel_speed(np.zeros((10, 3)))


def test_only_walking_windows_are_chosen() -> None:
    time = np.arange(40)[:, None] / FPS
    hips = np.stack([time * np.array([v, 0.0, 0.0]) for v in (0.5, 1.0, 1.3, 2.0)])
    assert metrics.at_walking_speed(hips).tolist() == [False, True, True, False]


def test_deformation_is_the_spread_of_distances() -> None:
    points = np.zeros((4, 3, 3))
    points[:, 1, 0] = (1.0, 3.0, 1.0, 3.0)  # distances to the others: 1 or 3, σ = 1
    assert metrics.deformation(points) == pytest.approx(2.0)
    moved = points + RANDOM.normal(size=(4, 1, 3))
    assert metrics.deformation(moved) == pytest.approx(2.0), "a body may move as a whole"


def test_windows_are_whole_and_consecutive() -> None:
    track = np.arange(23)[:, None]
    assert metrics.windows(track, 10)[..., 0].tolist() == [[*range(10)], [*range(10, 20)]]
    assert metrics.windows(track, 24).shape == (0, 24, 1)


def test_displacement_errors_take_the_best_sample() -> None:
    truth = RANDOM.normal(size=(5, 8, 201))
    samples = RANDOM.normal(size=(5, 4, 8, 201))
    samples[:, 2] = truth
    assert metrics.ade(samples, truth).max() == 0.0
    assert metrics.fde(samples, truth).max() == 0.0


def test_displacement_errors_are_distances_of_whole_poses() -> None:
    truth = np.zeros((8, 201))
    samples = np.zeros((1, 8, 201))
    samples[0, :, :2] = (3.0, 4.0)
    samples[0, -1, :2] = (0.0, 1.0)
    assert metrics.ade(samples, truth) == pytest.approx((7 * 5 + 1) / 8)
    assert metrics.fde(samples, truth) == pytest.approx(1.0)


def test_average_and_final_error_choose_their_own_samples() -> None:
    truth = np.zeros((2, 1))
    samples = np.array([[[0.0], [1.0]], [[5.0], [0.0]]])  # good on average; good at the end
    assert metrics.ade(samples, truth) == pytest.approx(0.5)
    assert metrics.fde(samples, truth) == 0.0


def test_diversity() -> None:
    same = np.tile(RANDOM.normal(size=(1, 8, 201)), (6, 1, 1))
    assert metrics.apd(same) == 0.0
    apart = np.zeros((3, 2, 1))
    apart[:, 0, 0] = (0.0, 1.0, 2.0)
    assert metrics.apd(apart) == pytest.approx((1 + 2 + 1) / 3)
    with pytest.raises(InvalidArgument, match="two samples"):
        metrics.apd(apart[:1])


def test_multimodal_errors_are_plain_ones_when_no_seeds_are_alike() -> None:
    samples, truths = RANDOM.normal(size=(4, 3, 8, 6)), RANDOM.normal(size=(4, 8, 6))
    seeds = np.arange(4.0)[:, None] * 10
    average, final = metrics.multimodal_errors(samples, truths, seeds, epsilon=1.0)
    assert average == pytest.approx(metrics.ade(samples, truths).mean())
    assert final == pytest.approx(metrics.fde(samples, truths).mean())


def test_multimodal_errors_average_over_all_true_futures_of_a_seed() -> None:
    truths = np.array([[[0.0]], [[2.0]]])
    samples = np.array([[[[0.0]]], [[[0.0]]]])
    average, _ = metrics.multimodal_errors(samples, truths, np.zeros((2, 1)), epsilon=0.1)
    assert average == pytest.approx(1.0)


def test_marker_distance_is_in_millimetres() -> None:
    truth = RANDOM.normal(size=(7, 67, 3))
    assert metrics.amd(truth + np.array([0.003, 0.0, 0.004]), truth) == pytest.approx(5.0)
