"""Figures of crowds, from tracks that are known."""

import numpy as np
import pytest
from benchmarks.crowd_figures import RATE, stream_figures


def test_density_and_speed_of_a_stream_are_those_of_its_middle_half():
    rows, across = 24, 4
    x, y = np.meshgrid(np.arange(across) + 0.5, -0.5 * np.arange(rows))
    start = np.stack([x.ravel(), y.ravel()], -1)
    seconds = np.arange(round(10 * RATE)) / RATE
    place = start + seconds[:, None, None] * np.array([0, 0.5])
    front = np.argsort(-start[:, 1], kind="stable")[: across * 3]
    place[:, front, 1] += seconds[:, None]  # the front goes ahead
    row = stream_figures(4.0, place)
    assert row["m/s"] == pytest.approx(0.5)
    assert row["per_m2"] == pytest.approx(2, rel=0.1)
    assert row["diagram_m/s"] == pytest.approx(0.54, rel=0.1)
