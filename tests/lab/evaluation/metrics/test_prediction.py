"""Errors of predictors and regressors on arrays whose right answers are known."""

import numpy as np
import pytest

from wayfarer.errors import InvalidArgument
from wayfarer_lab.evaluation.metrics import prediction

RANDOM = np.random.default_rng(0)


def test_displacement_errors_take_the_best_sample() -> None:
    truth = RANDOM.normal(size=(5, 8, 201))
    samples = RANDOM.normal(size=(5, 4, 8, 201))
    samples[:, 2] = truth
    assert prediction.ade(samples, truth).max() == 0.0
    assert prediction.fde(samples, truth).max() == 0.0


def test_displacement_errors_are_distances_of_whole_poses() -> None:
    truth = np.zeros((8, 201))
    samples = np.zeros((1, 8, 201))
    samples[0, :, :2] = (3.0, 4.0)
    samples[0, -1, :2] = (0.0, 1.0)
    assert prediction.ade(samples, truth) == pytest.approx((7 * 5 + 1) / 8)
    assert prediction.fde(samples, truth) == pytest.approx(1.0)


def test_average_and_final_error_choose_their_own_samples() -> None:
    truth = np.zeros((2, 1))
    samples = np.array([[[0.0], [1.0]], [[5.0], [0.0]]])  # good on average; good at the end
    assert prediction.ade(samples, truth) == pytest.approx(0.5)
    assert prediction.fde(samples, truth) == 0.0


def test_diversity() -> None:
    same = np.tile(RANDOM.normal(size=(1, 8, 201)), (6, 1, 1))
    assert prediction.apd(same) == 0.0
    apart = np.zeros((3, 2, 1))
    apart[:, 0, 0] = (0.0, 1.0, 2.0)
    assert prediction.apd(apart) == pytest.approx((1 + 2 + 1) / 3)
    with pytest.raises(InvalidArgument, match="two samples"):
        prediction.apd(apart[:1])


def test_multimodal_errors_are_plain_ones_when_no_seeds_are_alike() -> None:
    samples, truths = RANDOM.normal(size=(4, 3, 8, 6)), RANDOM.normal(size=(4, 8, 6))
    seeds = np.arange(4.0)[:, None] * 10
    average, final = prediction.multimodal_errors(samples, truths, seeds, epsilon=1.0)
    assert average == pytest.approx(prediction.ade(samples, truths).mean())
    assert final == pytest.approx(prediction.fde(samples, truths).mean())


def test_multimodal_errors_average_over_all_true_futures_of_a_seed() -> None:
    truths = np.array([[[0.0]], [[2.0]]])
    samples = np.array([[[[0.0]]], [[[0.0]]]])
    average, _ = prediction.multimodal_errors(samples, truths, np.zeros((2, 1)), epsilon=0.1)
    assert average == pytest.approx(1.0)


def test_marker_distance_is_in_millimetres() -> None:
    truth = RANDOM.normal(size=(7, 67, 3))
    assert prediction.amd(truth + np.array([0.003, 0.0, 0.004]), truth) == pytest.approx(5.0)
