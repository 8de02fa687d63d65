"""Smoothing: a half-life means the same everywhere, and chunks do not matter."""

import numpy as np
import pytest

from wayfarer.spec import FPS
from wayfarer.world.springs import approached, followed, sprung

ZERO = np.zeros(1, np.float32)
STEP = np.ones((2 * FPS, 1), np.float32)


@pytest.mark.parametrize("half_life", [0.05, 0.1, 0.25])
def test_half_of_the_way_is_left_after_each_half_life(half_life):
    found = followed(ZERO, STEP, half_life)[:, 0]
    after = np.arange(1, 4) * round(half_life * FPS)
    np.testing.assert_allclose(1 - found[after - 1], [1 / 2, 1 / 4, 1 / 8], atol=1e-6)


def test_a_spring_sets_off_softly_comes_close_and_never_goes_beyond():
    found, _ = sprung(ZERO, ZERO, STEP, 0.1)
    steps = np.diff(np.concatenate([ZERO, found[:, 0]]))
    assert (steps >= 0).all() and found[-1, 0] == pytest.approx(1, abs=1e-3)
    assert steps[0] < steps[1] and 0.1 < np.argmax(found[:, 0] > 0.5) / FPS < 0.2


def test_pieces_of_frames_make_no_difference():
    whole, _ = sprung(ZERO, ZERO, STEP, 0.1)
    first, rise = sprung(ZERO, ZERO, STEP[:7], 0.1)
    rest, _ = sprung(first[-1], rise, STEP[7:], 0.1)
    np.testing.assert_allclose(np.concatenate([first, rest]), whole, atol=1e-6)


def test_what_approaches_keeps_to_its_speed_and_stays_while_held():
    held = np.zeros(STEP.shape, np.bool_)
    held[10:20] = True
    found = approached(ZERO, STEP, held, 0.8)[:, 0]
    steps = np.diff(np.concatenate([ZERO, found]))
    assert steps.max() == pytest.approx(0.8 / FPS) and not steps[10:20].any()
    assert found[-1] == 1
