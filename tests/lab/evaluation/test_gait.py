"""Rows of gait figures."""

import numpy as np
import pytest

from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer_lab.evaluation.gait import WINDOW_FRAMES, Windows, gait_row

SOLES = np.arange(8)


def gliding(speed: float, seconds: int = 3) -> Windows:
    """A rigid body that glides along Y with both feet on the floor."""
    time = np.arange(seconds * FPS)[:, None] / FPS
    hips = time * np.array([0.0, speed, 0.0]) + np.array([0.0, 0.0, 0.9])
    spots = np.array([[x, 0.05 * toe, -0.9] for x in (-0.1, 0.1) for toe in range(4)])
    return Windows.cut(hips[:, None] + spots, hips)


def test_windows_hold_whole_steps() -> None:
    assert WINDOW_FRAMES % NEW_FRAMES == 0
    assert gliding(1.0).markers.shape == (3, WINDOW_FRAMES, 8, 3)


def test_a_gliding_body_is_seen_for_what_it_is() -> None:
    row = gait_row("glide", gliding(1.0), SOLES)
    assert row["speed_mps"] == pytest.approx(1.0)
    assert row["slide_cm_s"] == pytest.approx(100.0)
    assert row["both_feet_skating"] == 1.0
    assert row["contact_strict"] == pytest.approx(np.exp(-0.925))
    assert row["penetration_cm"] == pytest.approx(0.0, abs=1e-9)
    assert row["floating_5cm"] == 0.0


def test_only_windows_of_walking_speed_are_compared() -> None:
    both = Windows.join([gliding(1.2), gliding(3.0)])
    assert len(both.markers) == 6
    assert gait_row("matched", both.at_walking_speed(), SOLES)["speed_mps"] == pytest.approx(1.2)


def test_seams_are_looked_for_where_they_lie() -> None:
    time = np.arange(90)[:, None] / FPS
    hips = np.concatenate([0.3 * time**2, time, np.full((90, 1), 0.9)], -1)
    hips[:, 1] += 0.01 * (np.arange(90) // 9)  # a jump before every ninth frame
    row = {
        every: gait_row("x", Windows.cut(np.tile(hips[:, None], (1, 8, 1)), hips, every), SOLES)
        for every in (8, 9)
    }
    assert row[9]["windows"] == 2 and row[9]["seam_ratio"] > 5
    assert row[8]["seam_ratio"] < row[9]["seam_ratio"] / 2


def test_no_windows_give_no_figures() -> None:
    assert gait_row("none", gliding(3.0).at_walking_speed(), SOLES) == {
        "name": "none",
        "windows": 0,
    }
