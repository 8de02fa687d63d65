import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wayfarer_lab.training.mocap.resample import resample


def motion(fps: float, seconds: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    t = np.arange(0, seconds + 1e-9, 1 / fps)
    places = np.stack([t, np.sin(2 * t), 0 * t], -1)[:, None]
    return places, Rotation.from_euler("z", 2 * t[:, None]).as_matrix()[:, None]


@pytest.mark.parametrize("fps", [24, 30, 40, 60, 100, 120, 240])
def test_any_rate_becomes_40(fps: float) -> None:
    places, turns = resample(*motion(fps), fps, 40)
    wanted_places, wanted_turns = motion(40)
    assert len(places) == len(turns) == len(wanted_places)
    inside = slice(2, -2)  # smoothing holds the edges
    np.testing.assert_allclose(places[inside], wanted_places[inside], atol=2e-3)
    np.testing.assert_allclose(turns[inside], wanted_turns[inside], atol=2e-3)
    np.testing.assert_allclose(np.linalg.det(turns), 1, atol=1e-9)


def test_what_the_lower_rate_cannot_hold_is_taken_away() -> None:
    t = np.arange(0, 2, 1 / 120)
    places = np.zeros((len(t), 1, 3))
    places[:, 0, 0] = np.sin(2 * np.pi * 40 * t + 1)  # would fold to a constant offset
    turns = np.broadcast_to(np.eye(3), (len(t), 1, 3, 3))
    assert np.abs(resample(places, turns, 120, 40)[0][3:-3]).max() < 0.05
