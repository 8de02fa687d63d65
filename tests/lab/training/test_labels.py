"""Frames are labelled by their activity."""

import numpy as np
import pytest

from wayfarer.spec import FPS
from wayfarer_lab.training.dataset import label_motion


def moving(direction_deg: float, speed: float, seconds: float = 3.0, turning: float = 0.0):
    """Hips [N, 3] and their rotations: facing +Y at first, going at an angle to the left."""
    n = round(seconds * FPS)
    heading = np.arange(n) / FPS * turning
    rotations = np.zeros((n, 4), np.float32)
    rotations[:, 2], rotations[:, 3] = np.sin(heading / 2), np.cos(heading / 2)
    way = heading + np.deg2rad(direction_deg)
    step = speed / FPS * np.stack([-np.sin(way), np.cos(way), np.zeros(n)], -1)
    return np.cumsum(step, 0), rotations


@pytest.mark.parametrize(
    ("direction", "speed", "label"),
    [
        (0, 1.2, "walk"),
        (0, 2.8, "run"),
        (90, 0.6, "sideways"),
        (-90, 0.6, "sideways"),
        (180, 0.8, "backward"),
        (0, 0.02, "standing"),
    ],
)
def test_steady_motion_is_named_by_its_direction_and_speed(direction, speed, label):
    assert set(label_motion(*moving(direction, speed))) == {label}


def test_turning_on_the_spot_is_a_turn_and_a_walked_curve_is_a_walk():
    assert set(label_motion(*moving(0, 0.02, turning=1.5))) == {"turn"}
    assert set(label_motion(*moving(0, 1.2, turning=0.8))) == {"walk"}


def test_setting_off_is_a_start():
    hips, rotations = moving(0, 1.2)
    hips = np.concatenate([np.repeat(hips[:1], 80, 0), hips])
    rotations = np.concatenate([rotations[:80], rotations])
    label = label_motion(hips, rotations)
    assert label[20] == "standing" and label[80] == "start_stop" and label[-20] == "walk"
