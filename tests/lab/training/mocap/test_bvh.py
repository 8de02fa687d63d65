import numpy as np
import pytest

from tests.lab.training.mocap.synthetic import (
    BVH_COLUMNS,
    BVH_JOINTS,
    bvh_text,
    edited,
    standing_rows,
)
from tests.lab.training.mocap.synthetic_files import bvh_of
from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.bvh import read_bvh
from wayfarer_lab.training.mocap.conversion import to_our_joints
from wayfarer_lab.training.mocap.rig import J, guess_unit
from wayfarer_lab.training.mocap.skeleton import MocapSkeleton, SkeletonMotion


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_reads_skeleton_and_motion(newline: str) -> None:
    rows = standing_rows(5)
    rows[:, 0] = np.arange(5)
    motion = read_bvh(bvh_text(rows, 60, newline))
    assert motion.fps == pytest.approx(60, rel=1e-4)
    assert motion.skeleton.names == tuple(n for n, *_ in BVH_JOINTS)
    _, places = motion.world()
    np.testing.assert_allclose(places[:, 0], rows[:, :3], atol=1e-6)


def test_becomes_metres_z_up_with_the_right_side_right() -> None:
    rows = standing_rows(3)
    rows[:, 3 + 1] = 90.0  # turn about the vertical, to the left: from facing +Z to facing +X
    motion = read_bvh(bvh_text(rows))
    places, rotations, rest = to_our_joints(motion, None, "y")
    assert guess_unit(motion.skeleton.rest_places()[[0, 1, 5, 9, 2, 6, 9, 3, 7]]) == 0.01
    assert rest[J["right_hip"], 0] > 0 > rest[J["left_hip"], 0]
    assert rest[J["left_foot"], 1] > rest[J["left_ankle"], 1]  # toes to +Y
    assert places[0, J["head"], 2] == pytest.approx(1.61)
    # +Z of the file is our -Y, so facing +X of the file stays +X
    np.testing.assert_allclose(rotations[0, 0] @ [0, 1, 0], [1, 0, 0], atol=1e-9)
    right = places[0, J["right_hip"]] - places[0, J["left_hip"]]
    np.testing.assert_allclose(right, [0, -0.2, 0], atol=1e-9)
    assert places[0, J["left_wrist"], 2] < places[0, J["left_shoulder"], 2]


def first_motion_line() -> int:
    return bvh_text(standing_rows(4)).split("\n").index("MOTION") + 1


@pytest.mark.parametrize(
    ("offset", "change", "reason"),
    [
        (1, lambda _: "Frames: many", "Frames"),
        (2, lambda _: "Frame Time: 0", "positive frame time"),
        (4, lambda text: text + " 1.0", f"needs {BVH_COLUMNS} numbers, got {BVH_COLUMNS + 1}"),
        (5, lambda text: text.replace("100.000000", "nan"), "not finite"),
        (5, lambda text: text.replace("100.000000", "1oo.0"), "could not convert"),
    ],
)
def test_malformed_motion_names_the_line(offset, change, reason) -> None:
    line = first_motion_line() + offset
    with pytest.raises(DataError, match=reason) as caught:
        read_bvh(edited(bvh_text(standing_rows(4)), line, change), "x.bvh")
    assert caught.value.line == line


def test_malformed_hierarchy_names_the_line() -> None:
    text = bvh_text(standing_rows(2))
    for line, change in ((4, "OFFSET 1 2"), (5, "CHANNELS 6 Xposition"), (6, "JOINT Hips")):
        with pytest.raises(DataError) as caught:
            read_bvh(edited(text, line, lambda _, c=change: c))
        assert caught.value.line == line
    with pytest.raises(DataError, match="the file ends"):
        read_bvh("\n".join(text.split("\n")[:-3]))


def test_hips_that_move_below_a_still_root_move() -> None:
    """As Bandai Namco's files have them; most others only restate the OFFSET, as Axis Neuron."""
    truth = read_bvh(bvh_text(standing_rows(5)))
    truth.root[:, 2] = np.arange(5)
    skeleton = MocapSkeleton(
        ("joint_Root", *truth.skeleton.names),
        (-1, *(p + 1 for p in truth.skeleton.parents)),
        np.concatenate([[[0, 0, 0]], [[0, 90, 0]], truth.skeleton.offsets[1:]]),
        {},
    )
    local = np.concatenate([np.tile(np.eye(3), (5, 1, 1, 1)), truth.local], axis=1)
    root = np.tile([7.0, 0, 3], (5, 1))
    moving = SkeletonMotion(skeleton, root, local, 120.0, {1: truth.root})
    motion = read_bvh(bvh_of(moving))
    assert list(motion.shifts) == [1]
    np.testing.assert_allclose(motion.world()[1][:, 1], truth.root + np.array([7, 0, 3]), atol=1e-5)
    places, _, rest = to_our_joints(motion.cut(2), None, "y")
    right = to_our_joints(truth.cut(2), None, "y")
    np.testing.assert_allclose(places, right[0] + [0.07, -0.03, 0], atol=1e-6)
    np.testing.assert_allclose(rest, right[2], atol=1e-6)


def test_position_channels_that_restate_the_offset_move_nothing() -> None:
    truth = read_bvh(bvh_text(standing_rows(3)))
    shifts = {j: np.tile(o, (3, 1)) for j, o in enumerate(truth.skeleton.offsets) if j}
    told = SkeletonMotion(truth.skeleton, truth.root, truth.local, truth.fps, shifts)
    motion = read_bvh(bvh_of(told))
    assert motion.shifts == {}
    np.testing.assert_allclose(motion.world()[1], truth.world()[1], atol=1e-5)


def test_unknown_skeletons_and_lying_rest_poses_are_refused() -> None:
    text = bvh_text(standing_rows(2))
    with pytest.raises(DataError, match="no joint for left_knee"):
        to_our_joints(read_bvh(text.replace("LeftLeg", "Stilt")), None, "y")
    with pytest.raises(DataError, match="upright"):
        to_our_joints(read_bvh(text.replace("OFFSET 0 -42 0", "OFFSET 0 0 42")), None, "y")
    giant = text.replace("OFFSET 0 -42 0", "OFFSET 0 -200 0")
    with pytest.raises(DataError, match="give --unit"):
        to_our_joints(read_bvh(giant), None, "y")
