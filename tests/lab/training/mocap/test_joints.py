"""The mapping of a file's joints to ours, by common conventions."""

import numpy as np
import pytest

from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.joints import joint_map
from wayfarer_lab.training.mocap.rig import JOINT_NAMES
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


OTHERS = {
    "Bandai Namco": (
        ("joint_Root", "Hips", "Spine", "Chest", "Neck", "Head"),
        "UpperLeg LowerLeg Foot Toes Shoulder UpperArm LowerArm Hand",
        lambda side, part: f"{part}_{side[0]}",
    ),
    "Unreal": (
        ("root", "pelvis", "spine_01", "spine_02", "spine_03", "neck_01", "head"),
        "thigh calf foot ball clavicle upperarm lowerarm hand",
        lambda side, part: f"{part}_{side[0].lower()}",
    ),
    "Biped": (
        *[("Bip01", *(f"Bip01 {n}" for n in ("Pelvis", "Spine", "Spine1", "Neck", "Head")))],
        "Thigh Calf Foot Toe0 Clavicle UpperArm Forearm Hand",
        lambda side, part: f"Bip01 {side[0]} {part}",
    ),
    "Motive": (
        ("Hip", "Ab", "Chest", "Neck", "Head"),
        "Thigh Shin Foot Toe Shoulder UArm FArm Hand",
        lambda side, part: side[0] + part,
    ),
    "Rokoko": (
        ("Hips", "Spine1", "Spine2", "Spine3", "Spine4", "Neck", "Head"),
        "Thigh Shin Foot Toe Shoulder Arm ForeArm Hand",
        lambda side, part: side + part,
    ),
    "a namespace": (
        ("Bob:Hips", "Bob:Spine", "Bob:Neck", "Bob:Head"),
        "UpLeg Leg Foot ToeBase Shoulder Arm ForeArm Hand",
        lambda side, part: f"Bob:{side}{part}",
    ),
}


@pytest.mark.parametrize("tool", OTHERS)
def test_joints_as_other_tools_name_them(tool) -> None:
    trunk, limbs, named = OTHERS[tool]
    names, parents = list(trunk), [k - 1 for k in range(len(trunk))]
    hips = next(k for k, n in enumerate(trunk) if "hip" in n.lower() or "pelvis" in n.lower())
    wanted = {}
    for side in ("Left", "Right"):
        ours = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")
        for k, (part, joint) in enumerate(zip(limbs.split(), ours, strict=True)):
            parents.append({0: hips, 4: len(trunk) - 3}.get(k, len(names) - 1))
            names.append(named(side, part))
            wanted[f"{side.lower()}_{joint}"] = names[-1]
    skeleton = MocapSkeleton(tuple(names), tuple(parents), np.zeros((len(names), 3)), {})
    found = {ours: names[row] for ours, row in zip(JOINT_NAMES, joint_map(skeleton), strict=True)}
    assert {bone: found[bone] for bone in wanted} == wanted
    assert found["pelvis"] == trunk[hips]
    assert (found["neck"], found["head"]) == trunk[-2:]
    assert found["spine3"] == trunk[-3]
    assert found["spine1"] == trunk[hips + 1]


def test_one_joint_cannot_be_collar_and_upper_arm() -> None:
    with pytest.raises(DataError, match="no joint for left_shoulder"):
        mapped(("Shoulder", "Elbow", "Wrist"))
