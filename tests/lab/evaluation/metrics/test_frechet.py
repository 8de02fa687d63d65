"""The Fréchet distance on known distributions, and its features."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.body.library import load_body
from wayfarer.spec import BETAS, FPS
from wayfarer_lab.evaluation.metrics import frechet

BODY = load_body("anny52", "male", "low")
NAMES = BODY.marker_names


def gliding(speed: float = 1.2, heading: float = 0.0, frames: int = 120) -> np.ndarray:
    """T-pose markers [T, 67, 3] that glide to where they face."""
    rest = BODY.rest_joints(np.zeros(BETAS))
    points = BODY.markers(np.zeros(BETAS), np.tile(np.eye(3), (len(rest), 1, 1)), rest)
    c, s = np.cos(heading), np.sin(heading)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    way = np.arange(frames)[:, None] / FPS * np.array([0.0, speed, 0.0])
    return (points + way[:, None]) @ turn.T


def test_like_distributions_have_no_distance() -> None:
    samples = np.random.default_rng(0).normal(size=(500, 6))
    assert frechet.frechet(samples, samples) == pytest.approx(0.0, abs=1e-9)


def test_a_shift_counts_by_its_square() -> None:
    samples = np.random.default_rng(0).normal(size=(500, 6))
    assert frechet.frechet(samples + np.array([3.0, 4, 0, 0, 0, 0]), samples) == pytest.approx(25.0)


def test_widths_differ_by_the_square_of_their_roots() -> None:
    # uncorrelated and of unit variance to the last digit: Σ is I, and k²I when scaled by k
    raw = np.random.default_rng(0).normal(size=(500, 3))
    raw -= raw.mean(0)
    white = raw @ np.linalg.inv(np.linalg.cholesky(np.cov(raw, rowvar=False)).T)
    assert frechet.frechet(3 * white, white) == pytest.approx(3 * (3 - 1) ** 2)


@given(heading=st.floats(-3.0, 3.0), speed=st.floats(0.1, 3.0))
def test_the_feature_knows_speed_but_neither_place_nor_heading(
    heading: float, speed: float
) -> None:
    values = frechet.features(gliding(speed, heading) + np.array([5.0, -3.0, 0.0]), NAMES)
    assert values.shape == (6, frechet.SIZE)  # windows begin at frames 0, 8 … 40
    right, forward = values[:, 0], values[:, 1]
    assert forward == pytest.approx(speed, abs=1e-5)
    assert right == pytest.approx(0.0, abs=1e-5)
    assert values == pytest.approx(frechet.features(gliding(speed), NAMES), abs=1e-5)


def test_the_feature_sees_arms_that_swing_against_each_other() -> None:
    def swung(sign: float) -> float:
        motion = gliding()
        swing = 0.2 * np.sin(2 * np.pi * np.arange(len(motion)) / FPS)
        for site, side in (("left hand", 1.0), ("left foot", sign)):
            rows = [NAMES.index(name) for name in frechet.SITES[site]]
            motion[:, rows, 1] += side * swing[:, None]
        return float(frechet.features(motion, NAMES)[:, -2].mean())

    assert swung(1.0) > 0.9 and swung(-1.0) < -0.9


def test_short_tracks_have_no_windows() -> None:
    assert frechet.features(gliding(frames=79), NAMES).shape == (0, frechet.SIZE)
    assert frechet.features(gliding(frames=80), NAMES).shape == (1, frechet.SIZE)


def test_too_few_windows_give_no_figure() -> None:
    many = np.random.default_rng(1).normal(size=(frechet.MIN_WINDOWS, frechet.SIZE))
    reference = frechet.Reference(many)
    assert np.isnan(reference.distance(many[:-1]))
    assert reference.distance(many) == pytest.approx(0.0, abs=1e-6)
    assert np.isnan(frechet.Reference.of([], NAMES).distance(many))


def test_the_reference_sets_the_unit_of_each_number() -> None:
    many = np.random.default_rng(1).normal(size=(200, frechet.SIZE))
    scale = np.linspace(0.01, 100, frechet.SIZE)
    plain = frechet.Reference(many).distance(many + 1.0)
    assert frechet.Reference(many * scale).distance((many + 1.0) * scale) == pytest.approx(
        plain, rel=1e-3
    )
