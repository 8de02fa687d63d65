import numpy as np
from scipy.spatial.transform import Rotation

from tests.lab.training.mocap.synthetic import bvh_text, standing_rows
from wayfarer_lab.training.mocap import repair
from wayfarer_lab.training.mocap.bvh import read_bvh
from wayfarer_lab.training.mocap.skeleton import MocapSkeleton


def cgspeed_skeleton() -> MocapSkeleton:
    names = ["Spine1", "Neck", "LeftShoulder", "RightShoulder"]
    names += ["LeftHand", "LeftFingerBase", "LThumb", "RightHand", "RightFingerBase", "RThumb"]
    parents = (-1, 0, 0, 0, 2, 4, 4, 3, 7, 7)
    offsets = np.zeros((10, 3))
    offsets[0], offsets[4], offsets[7] = (0, 2, 0), (4, 0, 0), (-4, 0, 0)
    return MocapSkeleton(tuple(names), parents, offsets, {})


def test_lost_cmu_bones_are_estimated() -> None:
    mended = repair.mend_cmu_bvh(cgspeed_skeleton())
    offset = dict(zip(mended.names, mended.offsets.tolist(), strict=True))
    assert offset["Neck"] == offset["LeftShoulder"] == offset["RightShoulder"] == [0, 2, 0]
    assert offset["LeftFingerBase"] == offset["LThumb"] == [2, 0, 0]
    assert offset["RightFingerBase"] == [-2, 0, 0]


def test_lost_cmu_bones_are_taken_from_the_asf() -> None:
    asf = MocapSkeleton(
        ("root", "lowerneck", "lhand", "rhand"),
        (-1, 0, 0, 0),
        np.array([[0, 0, 0], [0, 3, 0], [1.5, 0, 0], [-1.5, 0, 0.0]]),
        {},
    )
    mended = repair.mend_cmu_bvh(cgspeed_skeleton(), asf)
    offset = dict(zip(mended.names, mended.offsets.tolist(), strict=True))
    assert offset["Neck"] == [0, 3, 0]
    assert offset["RThumb"] == [-1.5, 0, 0]


def test_other_skeletons_are_left_alone() -> None:
    skeleton = read_bvh(bvh_text(standing_rows(2))).skeleton
    assert repair.mend_cmu_bvh(skeleton) is skeleton


def test_an_added_t_pose_is_dropped_and_a_real_first_frame_is_kept() -> None:
    rows = standing_rows(4)
    assert len(repair.drop_t_pose(read_bvh(bvh_text(rows)))) == 4
    rows[0, 3:] = 0
    assert len(repair.drop_t_pose(read_bvh(bvh_text(rows)))) == 3


def test_untracked_arms_are_counted_at_the_start_only() -> None:
    arms = np.broadcast_to(np.eye(3), (6, 2, 3, 3)).copy()
    tilted = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]])
    arms[:, 0] = tilted
    arms[2:4, 1] = tilted
    assert repair.missing_arm_frames(arms) == 2
    assert repair.missing_arm_frames(arms[2:]) == 0


def test_a_flip_of_a_frame_is_taken_out_and_fast_turns_are_kept() -> None:
    angles = np.linspace(0, 4, 40)  # 4 rad/s at 40 fps
    clean = Rotation.from_euler("x", angles[:, None]).as_matrix()
    flipped = clean.copy()
    flipped[17] = flipped[17] @ Rotation.from_euler("z", 2.0).as_matrix()
    mended = repair.despike(flipped)
    np.testing.assert_allclose(mended, clean, atol=0.15)
    np.testing.assert_array_equal(repair.despike(clean), clean)


def test_glitches_cut_a_clip_in_pieces() -> None:
    places = np.zeros((200, 22, 3))
    places[:, 0, 0] = np.linspace(0, 1.5, 200)
    places[:, 1:] = places[:, :1]
    places[60, 5, 2] = 1.0  # a joint jumps by a metre within a frame
    places[150:] += 2.0  # the root jumps
    pieces = repair.clean_pieces(places, 120, start=0, listed=[100])
    assert pieces[0][0] == 10  # the solver's first frames
    assert len(pieces) == 4
    for (_, end), (begin, _), glitch in zip(pieces, pieces[1:], (59, 100, 149), strict=False):
        assert end <= glitch < begin
