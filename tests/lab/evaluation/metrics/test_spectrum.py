"""Power of swings whose frequency is known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.metrics.spectrum import BANDS, angular_power, band_power

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


def test_angular_power_is_that_of_the_joint_that_shakes() -> None:
    time = np.arange(10 * FPS) / FPS
    turns = np.zeros((len(time), 3, 3))
    turns[:, 1, 0] = 0.02 * np.sin(2 * np.pi * 8 * time)
    rotations = Rotation.from_rotvec(turns.reshape(-1, 3)).as_quat().reshape(len(time), 3, 4)
    power = angular_power(rotations)
    # a sine of 0.02 rad at 8 Hz, of which differences of frames see sin(πf/F) / (πf/F)
    seen = np.sinc(8 / FPS) ** 2 * (0.02 * 2 * np.pi * 8) ** 2 / 2
    assert power[2] == pytest.approx(seen, rel=0.1) and power[[0, 1, 3]].max() < 0.1 * power[2]
    assert not angular_power(rotations[:1].repeat(200, 0)).any(), "a statue"
    assert np.isnan(angular_power(rotations[:40])).all()
