"""Figures of crowds, from tracks that are known."""

import numpy as np
import pytest
from benchmarks.crowd_figures import RATE, longest_still, stream_figures


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


def test_a_stand_counts_until_it_is_told_and_again_once_the_person_has_gone_on():
    metres = np.concatenate([np.zeros(80), np.full(120, 1.0)])  # 8 s, then 12
    place, never = np.stack([metres, np.zeros(200)], -1)[:, None], np.array([np.inf])
    assert longest_still(place, never) == pytest.approx(12, abs=0.2)
    assert longest_still(place, never, [(12.0, 0)]) == pytest.approx(8, abs=0.2)
    assert longest_still(place, never, [(4.0, 0), (15.0, 0)]) == pytest.approx(7, abs=0.2)
    assert longest_still(place, never, [(4.0, 0)]) == pytest.approx(12, abs=0.2)
