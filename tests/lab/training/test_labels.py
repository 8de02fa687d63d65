"""Frames are labelled by their activity."""

import numpy as np
import pytest

from wayfarer.spec import FPS
from wayfarer_lab.training.dataset import group_of, label_motion
from wayfarer_lab.training.mocap.rig import J
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.standing import knee_bend


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


@pytest.mark.parametrize(
    ("use", "done", "acted", "crouched", "group"),
    [
        (Use.LOCOMOTION, "standing", False, False, "standing"),
        (Use.STANDING, "start_stop", False, False, "standing"),
        (Use.LOCOMOTION, "standing", False, True, "other"),
        (Use.STANDING, "standing", True, False, "other"),
        (Use.LOCOMOTION, "walk", False, True, "walk"),
        (Use.LOCOMOTION, "walk", True, False, "other"),
        (Use.LOCOMOTION, "sideways", True, True, "sideways"),
        (Use.OTHER, "walk", False, False, "other"),
        (Use.EXCLUDED, "walk", False, False, ""),
    ],
)
def test_acted_styles_teach_what_is_scarce_and_nobody_learns_to_stand_from_a_crouch(
    use, done, acted, crouched, group
):
    assert group_of(use, done, acted, crouched) == group


def test_the_bend_of_the_knees_is_their_mean():
    rotations = np.tile(np.array([0, 0, 0, 1], np.float32), (2, 22, 1))
    half = np.deg2rad(15.0)
    rotations[1, J["left_knee"]] = [-np.sin(half), 0, 0, np.cos(half)]  # 30°
    assert np.rad2deg(knee_bend(rotations)) == pytest.approx([0, 15], abs=1e-3)
