"""Upper bodies of acted takes are replaced with those of plain takes with similar legs."""

import numpy as np
import pytest

from wayfarer.body.library import load_body
from wayfarer.errors import DataError
from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.fit import FittedClip
from wayfarer_lab.training.mocap.rig import ClipInfo, J
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.shape import own_shape
from wayfarer_lab.training.mocap.upper import plain_uppers

N = 4 * FPS


def walk(name: str, arms: float, phase: float = 0.0, split: str = "train") -> FittedClip:
    """Thighs swing by 0.4 rad, and arms `arms` times as far against them."""
    body = load_body("anny52", "male", "low")
    rest = body.rest_joints(np.zeros(body.betas))[:22]
    t = np.arange(N) / FPS
    swing = 0.4 * np.sin(2 * np.pi * t + phase)
    rotations = np.zeros((N, 22, 4), np.float32)
    rotations[..., 3] = 1
    for side, sign in (("left", 1), ("right", -1)):
        about_x(rotations, J[f"{side}_hip"], sign * swing)
        about_x(rotations, J[f"{side}_shoulder"], -sign * arms * swing)
    place = np.stack([0 * t, 1.2 * t, 0 * t + 0.9], -1).astype(np.float32)
    info = ClipInfo(name, name, "x", split)
    return FittedClip(
        info, own_shape(body, rest), place, rotations, np.ones((N, 2, 2), bool),
        np.full(N, Use.LOCOMOTION, np.uint8), np.zeros((N, 22)),
    )  # fmt: skip


def about_x(rotations, joint, angle):
    rotations[:, joint, 0], rotations[:, joint, 3] = np.sin(angle / 2), np.cos(angle / 2)


def test_an_acted_upper_body_becomes_that_of_plain_legs_in_phase():
    plain, acted = walk("Neutral_FW", arms=1.0), walk("Chicken_FW", arms=0.0, phase=1.0)
    wanted = walk("Wanted", arms=1.0, phase=1.0)
    first, second = plain_uppers([plain, acted], ["Chicken_*"])
    assert first is plain
    legs = [J["left_hip"], J["right_knee"], 0]
    np.testing.assert_array_equal(second.rotations[:, legs], acted.rotations[:, legs])
    shoulder = J["left_shoulder"]
    middle = slice(20, -20)
    off = second.rotations[middle, shoulder, 0] - wanted.rotations[middle, shoulder, 0]
    assert np.abs(off).max() < 0.02


def test_takes_for_validation_stay_as_recorded():
    held = walk("Chicken_SW", arms=0.0, split="validation")
    assert plain_uppers([walk("Neutral_FW", 1.0), held], ["Chicken_*"])[1] is held


def test_without_plain_takes_there_is_nothing_to_learn_from():
    with pytest.raises(DataError, match="no plain take"):
        plain_uppers([walk("Chicken_FW", arms=0.0)], ["*"])
