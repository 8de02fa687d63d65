"""Start poses are recorded stands, as they are."""

from dataclasses import replace

import numpy as np
import pytest

from tests.lab.training.fakes import straight_walks
from wayfarer.world.agents.heading import facing_of
from wayfarer_lab.training.mocap.rig import J
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.standing import knee_bend, save_start_poses, standing_poses


def stands(bends, names=("07_01", "07_02", "08_01")):
    """A data set of people who stand, whose knees bend by `bends` (degrees)."""
    walks = straight_walks(length=100)
    rotations = np.zeros_like(walks.rotations)
    rotations[..., 3] = 1
    for side, sign in (("left", -1), ("right", 1)):  # hanging arms
        rotations[:, J[f"{side}_shoulder"]] = [0, sign * np.sqrt(0.5), 0, np.sqrt(0.5)]
    clips = []
    for clip, name, bend in zip(walks.clips, names, bends, strict=False):
        half = np.deg2rad(bend) / 2
        knees = rotations[clip.start : clip.stop, [J["left_knee"], J["right_knee"]]]
        knees[..., 0], knees[..., 3] = np.sin(half), np.cos(half)
        rotations[clip.start : clip.stop, [J["left_knee"], J["right_knee"]]] = knees
        shown = replace(clip, name=name, source=name, subject=name[:2], split="train", shape="own")
        clips.append(shown)
    use = np.full(len(rotations), Use.STANDING, np.uint8)
    return replace(walks, rotations=rotations, use=use, clips=tuple(clips))


def bends_of(poses):
    return sorted({round(float(np.rad2deg(knee_bend(p.rotations[None])[0]))) for p in poses})


def test_who_stands_with_straight_legs_is_taken_as_it_stands_and_who_crouches_is_not():
    assert bends_of(standing_poses(stands((2.0, 13.0, 25.0)))) == [2]  # 13 is too like 2
    assert bends_of(standing_poses(stands((13.0, 25.0)))) == [13]
    assert standing_poses(stands((16.0,))) == []


def test_acted_styles_validation_and_other_uses_are_left_out():
    data = stands((2.0,))
    (clip,) = data.clips
    for other in (
        replace(clip, name="Chicken_ID"),
        replace(clip, split="validation"),
        replace(clip, shape="random"),
    ):
        assert standing_poses(replace(data, clips=(other,))) == []
    walks = replace(data, use=np.full_like(data.use, Use.LOCOMOTION))
    assert standing_poses(walks) == []


def test_poses_face_forward_and_have_their_mirror_images(tmp_path):
    data = stands((2.0,))
    data.rotations[:, 0] = [0, 0, np.sin(0.4), np.cos(0.4)]
    data.rotations[:, J["left_elbow"]] = [0, np.sin(0.1), 0, np.cos(0.1)]
    poses = standing_poses(data)
    save_start_poses(tmp_path, poses)
    with np.load(tmp_path / "start_poses.npz") as file:
        rotations, sources = file["rotations"], file["sources"]
    assert rotations.shape == (2, 22, 4) and set(sources) == {"07_01"}
    assert facing_of(rotations[:, 0]) == pytest.approx(np.array([[0, 1], [0, 1]]), abs=1e-6)
    left, right = J["left_elbow"], J["right_elbow"]
    assert np.abs(rotations[0, left]) == pytest.approx(np.abs(rotations[1, right]), abs=1e-6)
