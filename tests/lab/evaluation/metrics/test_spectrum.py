"""Power of swings whose frequency is known."""

import numpy as np
import pytest

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.metrics.spectrum import BANDS, band_power

TIME = np.arange(8 * FPS) / FPS


@pytest.mark.parametrize(("hertz", "band"), [(1.25, 0), (4.375, 1), (8.125, 2), (15.0, 3)])
def test_a_swing_has_its_power_in_its_band(hertz: float, band: int) -> None:
    places = np.zeros((len(TIME), 2, 3))
    places[:, 0, 1] = 0.05 * np.sin(2 * np.pi * hertz * TIME)
    power = band_power(places)
    velocity = np.diff(places[:, 0, 1]) * FPS
    mean_square = (velocity**2).mean() / 2  # one of two joints moves
    assert power[band] == pytest.approx(mean_square, rel=0.1)
    assert power.sum() - power[band] < 0.1 * power[band]


def test_an_even_way_has_none_and_half_the_swing_a_quarter() -> None:
    places = np.zeros((len(TIME), 1, 3))
    places[:, 0, 1] = 1.4 * TIME
    assert band_power(places) == pytest.approx(np.zeros(len(BANDS)), abs=1e-9)
    wide, narrow = (
        band_power(places + size * np.sin(2 * np.pi * 8 * TIME)[:, None, None])
        for size in (0.02, 0.01)
    )
    assert wide[2] == pytest.approx(4 * narrow[2])


def test_too_short_a_take_has_no_spectrum() -> None:
    assert np.isnan(band_power(np.zeros((40, 1, 3)))).all()
