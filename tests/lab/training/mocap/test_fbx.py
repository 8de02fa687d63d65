"""FBX files of several tools' habits, made from a motion whose places are known."""

import os
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.lab.training.mocap.synthetic import bvh_text, standing_rows
from tests.lab.training.mocap.synthetic_files import bones_along_y, fbx_of, with_axes
from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.bvh import read_bvh
from wayfarer_lab.training.mocap.conversion import to_our_joints
from wayfarer_lab.training.mocap.fbx import read_fbx
from wayfarer_lab.training.mocap.joints import joint_map
from wayfarer_lab.training.mocap.skeleton import SkeletonMotion
from wayfarer_lab.training.mocap.stance import stands

pytest.importorskip("ufbx")

FRAMES = 24


@pytest.fixture(scope="module")
def walk() -> SkeletonMotion:
    """A person that strides ahead, in centimetres and Y up, 30 frames per second."""
    rows = standing_rows(FRAMES)
    rows[:, 2] = 4.0 * np.arange(FRAMES)
    rows[:, 5] = 10  # the hips lean ahead
    rows[:, 8] = 30 * np.sin(np.linspace(0, 6, FRAMES)) - 35  # a thigh
    rows[:, 11] = 50
    return read_bvh(bvh_text(rows, 30.0))


def written(tmp_path, text: str):
    path = tmp_path / "a.fbx"
    path.write_text(text)
    return path


def check(motion: SkeletonMotion, truth: SkeletonMotion, turns: bool = True) -> None:
    """Compares places, and rotations if the zero pose is the same."""
    found, right = (to_our_joints(m, None, "y") for m in (motion, truth))
    assert motion.fps == pytest.approx(30.0, abs=0.01)
    np.testing.assert_allclose(found[0], right[0], atol=1e-4)
    np.testing.assert_allclose(found[2], right[2], atol=1e-4)
    if turns:
        np.testing.assert_allclose(found[1], right[1], atol=1e-4)


def test_a_motion_is_read_as_it_was_written(walk, tmp_path) -> None:
    (take,) = read_fbx(written(tmp_path, fbx_of({"Take 001": walk})))
    assert take.name == "Take 001"
    assert len(take.motion) == FRAMES
    check(take.motion, walk)


def test_the_saved_pose_does_not_matter_where_zero_rotations_stand(walk, tmp_path) -> None:
    (take,) = read_fbx(written(tmp_path, fbx_of({"a": walk}, saved=5)))
    check(take.motion, walk)


@pytest.mark.parametrize("unit", [2.54, 100.0])
def test_the_declared_unit_counts(unit, walk, tmp_path) -> None:
    skeleton = walk.skeleton
    small = SkeletonMotion(
        skeleton.with_offsets(
            {n: o / unit for n, o in zip(skeleton.names, skeleton.offsets, strict=True)}
        ),
        walk.root / unit,
        walk.local,
        walk.fps,
    )
    (take,) = read_fbx(written(tmp_path, fbx_of({"a": small}, unit=unit)))
    check(take.motion, walk)


def test_z_up_and_a_turned_and_scaled_node_above(walk, tmp_path) -> None:
    """As Blender writes: an armature of scale 100 that stands the person up in a world of Z up."""
    armature = (
        'P: "Lcl Rotation", "Lcl Rotation", "", "A",90,0,0\n'
        'P: "Lcl Scaling", "Lcl Scaling", "", "A",100,100,100\n'
    )
    skeleton = walk.skeleton
    metres = SkeletonMotion(
        skeleton.with_offsets(
            {n: o / 100 for n, o in zip(skeleton.names, skeleton.offsets, strict=True)}
        ),
        walk.root / 100,
        walk.local,
        walk.fps,
    )
    text = fbx_of({"a": metres}, above=(("Armature", armature),), up=2)
    (take,) = read_fbx(written(tmp_path, text))
    check(take.motion, walk)


def test_a_root_on_the_floor_with_moving_hips_below(walk, tmp_path) -> None:
    text = fbx_of({"a": walk}, above=(("World", ""), ("Reference", "")), prefix="Actor:")
    (take,) = read_fbx(written(tmp_path, text))
    check(take.motion, walk)


def test_the_bind_pose_is_the_rest_pose_where_zero_rotations_do_not_stand(walk, tmp_path) -> None:
    turned = with_axes(walk, bones_along_y(walk))
    still = SkeletonMotion(walk.skeleton, walk.root, 0 * walk.local + np.eye(3), walk.fps)
    bind = with_axes(still, bones_along_y(walk))
    (take,) = read_fbx(written(tmp_path, fbx_of({"a": turned}, saved=3, bind=bind)))
    check(take.motion, walk)


def test_without_a_pose_that_stands_the_motion_is_read_all_the_same(walk, tmp_path) -> None:
    turned = with_axes(walk, bones_along_y(walk))
    (take,) = read_fbx(written(tmp_path, fbx_of({"a": turned}, saved=3)))
    skeleton = take.motion.skeleton
    assert not stands(skeleton.rest_places()[joint_map(skeleton)])
    _, places = take.motion.world()
    rows = joint_map(skeleton)
    _, right = walk.world()
    np.testing.assert_allclose(places[:, rows], right[:, joint_map(walk.skeleton)] / 100, atol=1e-4)


def test_takes_are_told_apart_and_still_or_repeated_ones_left_out(walk, tmp_path) -> None:
    still = SkeletonMotion(walk.skeleton, walk.root * 0, walk.local * 0 + np.eye(3), walk.fps)
    takes = {"walk": walk, "back": walk.cut(0, 12), "again": walk, "still": still}
    found = read_fbx(written(tmp_path, fbx_of(takes)))
    assert [(t.name, len(t.motion)) for t in found] == [("walk", FRAMES), ("back", 12)]


def test_rates_come_from_the_keys_and_otherwise_from_the_file(walk, tmp_path) -> None:
    (take,) = read_fbx(written(tmp_path, fbx_of({"a": walk}, rate=60.0)))
    assert take.motion.fps == pytest.approx(30, abs=0.01)
    thin = SkeletonMotion(walk.skeleton, walk.root[::6], walk.local[::6], 5.0)
    (take,) = read_fbx(written(tmp_path, fbx_of({"a": thin}, rate=48.0)))
    assert take.motion.fps == 48.0
    np.testing.assert_allclose(take.motion.root[24], walk.root[15] / 100, atol=1e-4)  # after 0.5 s


def test_what_cannot_be_read_is_refused_with_the_file(walk, tmp_path) -> None:
    def refused(text: str, reason: str) -> None:
        with pytest.raises(DataError, match=rf"a\.fbx: .*{reason}"):
            read_fbx(written(tmp_path, text))

    refused("nonsense", "cannot be read as FBX")
    refused(fbx_of({"a": walk})[:4000], "cannot be read as FBX|joint for|takes")
    refused(fbx_of({"a": walk}).replace("LeftLeg", "Stilt"), "no joint for left_knee")
    refused(fbx_of({"a": walk.cut(0, 1)}), "takes moves its joints")
    two = fbx_of({"a": walk}, prefix="A:")
    other = fbx_of({"b": walk}, prefix="B:")
    both = _joined(two, other)
    refused(both, "2 people")


def _joined(one: str, other: str) -> str:
    """The objects and links of two files in one."""
    other = re.sub(r"(?<![\d.*])(\d{4,6})(?![\d.])", r"9\1", other)
    objects = other.split("Objects: {\n")[1].split("\n}\nConnections")[0]
    links = other.split("Connections: {\n")[1].removesuffix("\n}\n")
    one = one.replace("\n}\nConnections", f"\n{objects}\n}}\nConnections")
    return one.removesuffix("\n}\n") + f"\n{links}\n}}\n"


def test_a_crash_of_the_reader_is_the_files_fault(walk, tmp_path, monkeypatch) -> None:
    path = written(tmp_path, fbx_of({"a": walk}))
    monkeypatch.setattr("wayfarer_lab.training.mocap.fbx._send", _die)
    with pytest.raises(DataError, match=r"a\.fbx: the FBX reader crashed"):
        read_fbx(path)


def _die(*_: object) -> None:
    os.abort()


def test_turning_people_keep_their_way(tmp_path) -> None:
    """Angles that pass ±180° are continuous between keys."""
    rows = standing_rows(40)
    rows[:, 4] = np.linspace(0, 720, 40)
    motion = read_bvh(bvh_text(rows, 30.0))
    (take,) = read_fbx(written(tmp_path, fbx_of({"a": motion})))
    check(take.motion, motion)
    assert Rotation.from_matrix(take.motion.local[9, 0]).magnitude() > 2.5
