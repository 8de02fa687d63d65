"""Files whose zero pose does not stand: a standing frame takes its place."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.lab.training.mocap.synthetic import BVH_JOINTS, bvh_text, standing_rows
from tests.lab.training.mocap.synthetic_files import bones_along_y, bvh_of, with_axes
from wayfarer.body.library import load_body
from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.bvh import read_bvh
from wayfarer_lab.training.mocap.conversion import to_our_joints
from wayfarer_lab.training.mocap.fit import FitOptions
from wayfarer_lab.training.mocap.joints import joint_map
from wayfarer_lab.training.mocap.load import ReadOptions, load_pieces, read_recordings
from wayfarer_lab.training.mocap.prepare import PrepareOptions, prepare
from wayfarer_lab.training.mocap.references import References
from wayfarer_lab.training.mocap.rig import J
from wayfarer_lab.training.mocap.skeleton import SkeletonMotion
from wayfarer_lab.training.mocap.sources import SourceFile
from wayfarer_lab.training.mocap.stance import standing_frame, stands, upward_axis

NAMES = [name for name, *_ in BVH_JOINTS]


def column(joint: str, axis: int) -> int:
    return 3 + 3 * NAMES.index(joint) + axis


def standing_then_crouching(frames: int = 60) -> SkeletonMotion:
    """Upright until half of it, with a turned heading; then the knees bend."""
    rows = standing_rows(frames)
    rows[:, column("Hips", 1)] = 40.0
    bend = np.clip(np.arange(frames) - frames / 2, 0, 10) * 6
    for side in ("Left", "Right"):
        rows[:, column(f"{side}UpLeg", 2)] = -bend
        rows[:, column(f"{side}Leg", 2)] = 2 * bend
    return read_bvh(bvh_text(rows, 60.0))


def lying(motion: SkeletonMotion) -> np.ndarray:
    """Axes that fold the legs of the zero pose to the front: it sits on the floor."""
    axes = np.tile(np.eye(3), (len(NAMES), 1, 1))
    fold = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    for j, name in enumerate(NAMES):
        if "Leg" in name or "Foot" in name or "Toe" in name:
            axes[j] = fold
    return axes


def anyhow(motion: SkeletonMotion) -> np.ndarray:
    return Rotation.random(len(NAMES), rng=np.random.default_rng(4)).as_matrix()


@pytest.mark.parametrize("axes", [bones_along_y, lying, anyhow])
def test_a_standing_frame_is_found_whatever_the_zero_pose_is(axes) -> None:
    truth = standing_then_crouching()
    motion = read_bvh(bvh_of(with_axes(truth, axes(truth))))
    skeleton = motion.skeleton
    assert not stands(skeleton.rest_places()[joint_map(skeleton)])
    with pytest.raises(DataError, match="does not stand upright"):
        to_our_joints(motion, None, "y")
    references = References()
    references.add("a", motion)
    reference, axis = references.find("a", motion)
    assert axis == "y"
    assert reference.frame < 32
    (note,) = references.notes()
    assert f"a: the zero pose does not stand; frame {reference.frame} of a" in note
    places, rotations, rest = to_our_joints(motion, None, "y", reference)
    right = to_our_joints(truth, None, "y")
    np.testing.assert_allclose(places, right[0], atol=1e-5)
    # the legs of the standing frame are those of the true zero pose
    legs = [J["left_hip"], J["left_knee"], J["left_foot"], J["right_ankle"]]
    np.testing.assert_allclose(rest[legs], right[2][legs], atol=1e-5)
    np.testing.assert_allclose(rotations[:, legs], right[1][:, legs], atol=1e-5)
    assert rest[J["left_wrist"], 2] < rest[J["left_elbow"], 2]  # its arms hang, and rest so


@pytest.mark.parametrize(
    ("joints", "axis", "angle"),
    [(("LeftForeArm", "RightForeArm"), 1, 80), (("Head", "Neck"), 2, 25), (("LeftArm",), 2, 60)],
)
def test_a_frame_with_straight_arms_and_a_level_head_is_preferred(joints, axis, angle) -> None:
    """Rotations relative to a bowed head would make all people look up."""
    rows = standing_rows(60)
    for joint in joints:
        rows[:40, column(joint, axis)] += angle
    motion = read_bvh(bvh_text(rows, 60.0))
    places = motion.world()[1][:, joint_map(motion.skeleton)]
    found = standing_frame(places, "y", 60.0)
    assert found is not None
    assert found[0] >= 40


def test_files_of_one_rig_share_the_frame_and_others_do_not() -> None:
    truth = standing_then_crouching()
    turned = with_axes(truth, bones_along_y(truth))
    crouching = turned.cut(45)
    longer = SkeletonMotion(
        turned.skeleton.with_offsets({"LeftLeg": turned.skeleton.offsets[2] * 1.1}),
        crouching.root, crouching.local, crouching.fps,
    )  # fmt: skip
    references = References()
    for name, motion in (("crouch", crouching), ("stand", turned), ("other", longer)):
        references.add(name, motion)
    assert references.find("crouch", crouching)[0].clip == "stand"
    with pytest.raises(DataError, match=r"nobody stands still in other: .*--reference CLIP:FRAME"):
        references.find("other", longer)
    assert "crouch and 1 more" in references.notes()[0]


def test_the_user_names_the_frame() -> None:
    truth = standing_then_crouching()
    motion = with_axes(truth, bones_along_y(truth))
    own = References("7")
    own.add("a", motion)
    assert own.find("a", motion)[0].frame == 7
    shared = References("a:9")
    shared.add("b", motion.cut(45))
    shared.add("a", motion)
    assert str(shared.find("b", motion)[0]) == "frame 9 of a"
    with pytest.raises(DataError, match="nobody stands upright in frame 59 of a"):
        References("59").add("a", motion)
    with pytest.raises(DataError, match="--reference 60: it has 60 frames"):
        References("60").add("a", motion)
    with pytest.raises(DataError, match="takes FRAME or CLIP:FRAME, got 'a:b'"):
        References("a:b")
    with pytest.raises(DataError, match="no clip z"):
        References("z:1").find("a", motion)


def test_somebody_who_lies_is_not_taken_for_standing_along_another_axis() -> None:
    truth = standing_then_crouching()
    on_the_back = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    local = truth.local[:30].copy()
    local[:, 0] = on_the_back @ local[:, 0]
    down = SkeletonMotion(truth.skeleton, truth.root[:30], local, truth.fps)
    rows = joint_map(down.skeleton)
    _, places = down.world()
    assert standing_frame(places[:, rows], "y", 60.0) is None
    assert upward_axis(places[:, rows], "y") == "z"
    axes = bones_along_y(truth)
    references = References()
    references.add("lies", with_axes(down, axes))
    references.add("stands", with_axes(truth, axes))
    reference, axis = references.find("lies", with_axes(down, axes))
    assert (reference.clip, axis) == ("stands", "y")


def entry(path, text: str) -> SourceFile:
    path.write_text(text)
    return SourceFile(path.stem, path, "s")


@pytest.mark.parametrize("zero", ["stands", "along y"])
def test_the_axis_that_points_up_is_found(zero, tmp_path) -> None:
    """As Blender writes BVH: Z up, in the zero pose too."""
    truth = standing_then_crouching()
    z_up = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    local = z_up @ truth.local[:, 0] @ z_up.T
    turned = with_axes(truth, np.tile(z_up.T, (len(NAMES), 1, 1)))
    turned.local[:, 0] = local
    motion = SkeletonMotion(turned.skeleton, truth.root @ z_up.T, turned.local, truth.fps)
    if zero == "along y":
        motion = with_axes(motion, bones_along_y(motion))
    (recording,) = read_recordings(entry(tmp_path / "z.bvh", bvh_of(motion)), None, ReadOptions())
    references = References()
    reference = up = None
    if not recording.stands:
        references.add("z", recording.motion)
        reference, up = references.find("z", recording.motion)
        assert up == "z"
    told: list[str] = []
    (piece,) = load_pieces(recording, ReadOptions(), reference, up, told.append)
    assert told == []
    assert piece.places[0, J["head"], 2] > piece.places[0, J["left_foot"], 2] + 1.4


def test_a_wrong_axis_is_told(tmp_path) -> None:
    options = ReadOptions(up="z")
    source = entry(tmp_path / "y.bvh", bvh_of(standing_then_crouching()))
    (recording,) = read_recordings(source, None, options)
    told: list[str] = []
    load_pieces(recording, options, tell=told.append)
    assert told == [
        "y: nobody in it stands along its z axis; if another one points up, say so with --up"
    ]


def test_a_folder_without_a_standing_zero_pose_is_prepared(tmp_path) -> None:
    truth = standing_then_crouching(120)
    axes = bones_along_y(truth)
    (tmp_path / "src").mkdir()
    entry(tmp_path / "src" / "stand.bvh", bvh_of(with_axes(truth.cut(0, 50), axes)))
    entry(tmp_path / "src" / "crouch.bvh", bvh_of(with_axes(truth.cut(0, 66), axes).cut(20)))
    entry(tmp_path / "src" / "plain.bvh", bvh_of(truth))
    options = PrepareOptions(fit=FitOptions(steps=2), shapes=1)
    bodies = {"male": load_body("anny52", "male")}
    done = prepare(tmp_path / "src", tmp_path / "dst", bodies, options)
    assert done.skipped == []
    assert {c.source for c in done.dataset.clips} == {"stand", "crouch", "plain"}
    assert any("the zero pose does not stand" in note for note in done.notes)
