"""Which joint of a file stands for which of ours, by the conventions that are about."""

import numpy as np
import pytest

from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.rig import JOINT_NAMES, joint_map
from wayfarer_lab.training.mocap.skeleton import MocapSkeleton

LEGS = ("Hip", "Knee", "Ankle", "Toe")
SPINE = ("Hips", "Chest", "Chest2", "Chest3", "Chest4", "Neck", "Head")


def mapped(arm: tuple[str, ...]) -> dict[str, str]:
    """Ours → theirs, of a skeleton with 100STYLE's legs and spine."""
    names = (*SPINE, *(f"{side}{part}" for side in ("Left", "Right") for part in (*LEGS, *arm)))
    skeleton = MocapSkeleton(names, (-1, *range(len(names) - 1)), np.zeros((len(names), 3)), {})
    return {ours: names[row] for ours, row in zip(JOINT_NAMES, joint_map(skeleton), strict=True)}


def test_beside_a_collar_the_shoulder_is_the_upper_arm() -> None:
    found = mapped(("Collar", "Shoulder", "Elbow", "Wrist"))
    assert (found["left_collar"], found["left_shoulder"]) == ("LeftCollar", "LeftShoulder")
    assert (found["right_elbow"], found["right_wrist"]) == ("RightElbow", "RightWrist")
    assert [found[f"spine{k}"] for k in (1, 2, 3)] == ["Chest", "Chest2", "Chest4"]


def test_beside_an_arm_the_shoulder_is_the_collar() -> None:
    found = mapped(("Shoulder", "Arm", "ForeArm", "Hand"))
    assert (found["left_collar"], found["left_shoulder"]) == ("LeftShoulder", "LeftArm")


def test_one_joint_cannot_be_collar_and_upper_arm() -> None:
    with pytest.raises(DataError, match="no joint for left_shoulder"):
        mapped(("Shoulder", "Elbow", "Wrist"))
