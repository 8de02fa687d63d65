import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.lab.training.mocap.synthetic import stepping
from wayfarer_lab.training.mocap.floor import BALLS, find_contacts, fit_tilt, floor_height
from wayfarer_lab.training.mocap.rig import J


def turned(places: np.ndarray, degrees: float) -> np.ndarray:
    return places @ Rotation.from_euler("z", degrees, degrees=True).as_matrix().T


def test_contacts_of_stepping_are_found() -> None:
    walk = stepping()
    found = find_contacts(walk.places, ankle=0.05)
    assert (found == walk.contacts).mean() > 0.93
    assert not found[walk.places[:, BALLS, 2] > 0.05].any()


def test_a_tilted_floor_is_levelled() -> None:
    walks = [stepping(160).places, turned(stepping(160).places, 80)]
    tilt = Rotation.from_rotvec(np.deg2rad([1.5, 0.7, 0])).as_matrix()
    back = fit_tilt([w @ tilt.T for w in walks])
    left = np.rad2deg(np.arccos((back @ tilt)[2, 2]))
    assert left < 0.25  # of 1.66 degrees


def test_a_floor_that_cannot_be_seen_is_taken_as_level() -> None:
    spot = stepping(400).places.copy()
    spot[..., 1] = np.sin(spot[..., 1]) * 0.05  # acting on the spot
    spot[:, J["left_foot"], 2] += 0.03
    np.testing.assert_array_equal(fit_tilt([spot]), np.eye(3))


def test_floor_height_is_that_of_standing_balls() -> None:
    places = stepping().places + np.array([0, 0, 0.3])
    assert floor_height(places) == pytest.approx(0.3, abs=0.01)
