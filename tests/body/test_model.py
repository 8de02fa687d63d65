"""Shape, kinematics and skinning of the shipped bodies."""

import numpy as np
import pytest

from wayfarer.body import landmarks, skeleton
from wayfarer.body.library import load_body
from wayfarer.body.rotation import matrix_from_quaternion, quaternion_from_rotvec
from wayfarer.errors import InvalidArgument
from wayfarer.spec import GENDERS

BODIES = [(gender, detail) for gender in GENDERS for detail in ("high", "low")]


@pytest.fixture(params=BODIES, ids=["-".join(b) for b in BODIES])
def body(request):
    return load_body("anny52", *request.param)


def random_local(rng, *shape, joints=52, deviation=0.4):
    rotvec = rng.normal(0, deviation, (*shape, joints, 3))
    return matrix_from_quaternion(quaternion_from_rotvec(rotvec))


def random_betas(count=20):
    return np.random.default_rng(1).normal(size=(count, 10))


def test_limbs_lie_along_the_axes_in_the_rest_pose(body):
    rest = dict(
        zip(body.joint_names, np.moveaxis(body.rest_joints(random_betas()), -2, 0), strict=True)
    )
    for bone, end, axis in (
        ("left_shoulder", "left_elbow", (-1, 0, 0)),
        ("left_elbow", "left_wrist", (-1, 0, 0)),
        ("right_shoulder", "right_elbow", (1, 0, 0)),
        ("right_elbow", "right_wrist", (1, 0, 0)),
        ("left_hip", "left_knee", (0, 0, -1)),
        ("right_knee", "right_ankle", (0, 0, -1)),
    ):
        along = rest[end] - rest[bone]
        cosine = along @ np.array(axis) / np.linalg.norm(along, axis=-1)
        assert np.degrees(np.arccos(cosine)).max() < 5.0, bone
    mean = dict(zip(body.joint_names, body.rest_joints(np.zeros(10)), strict=True))
    np.testing.assert_allclose(mean["left_wrist"][1:], mean["left_shoulder"][1:], atol=1e-3)
    np.testing.assert_allclose(mean["left_ankle"][:2], mean["left_hip"][:2], atol=1e-3)


def test_the_body_faces_y_with_palms_down(body):
    rest = dict(zip(body.joint_names, body.rest_joints(np.zeros(10)), strict=True))
    assert rest["left_foot"][1] > rest["left_ankle"][1] + 0.1
    assert rest["left_hip"][0] < 0 < rest["right_hip"][0]
    across = rest["left_index1"] - rest["left_pinky1"]  # thumb side forward
    assert across[1] > 0.9 * np.linalg.norm(across)


def test_every_shape_stands_on_the_floor(body):
    lowest = [body.rest_vertices(betas)[:, 2].min() for betas in random_betas()]
    assert np.abs(lowest).max() < 0.01
    soles = body.marker_vertices[body.sole_markers]
    heights = np.array([body.rest_vertices(betas, soles)[:, 2] for betas in random_betas()])
    assert np.abs(heights).max() < 0.01


def test_rest_places_are_linear_in_betas(body):
    a, b = random_betas(2)
    mean = body.rest_vertices(np.zeros(10))
    np.testing.assert_allclose(
        body.rest_vertices(a) - mean + body.rest_vertices(b), body.rest_vertices(a + b), atol=1e-9
    )


def test_skinning_agrees_with_kinematics(body):
    """Vertices that one bone owns move rigidly with it."""
    rng = np.random.default_rng(2)
    betas = random_betas(1)[0]
    rest = body.rest_joints(betas)
    turns, places = body.forward_kinematics(rng.normal(size=3), random_local(rng), rest)
    owned = np.flatnonzero(body.skin_weights[:, 0] > 1 - 1e-6)[:, None][:, 0]
    assert len(owned) > 100
    joint = body.skin_joints[owned, 0]
    start = body.rest_vertices(betas, owned) - rest[joint]
    expected = np.einsum("vab,vb->va", turns[joint], start) + places[joint]
    np.testing.assert_allclose(body.skin(betas, turns, places, owned), expected, atol=1e-5)


def test_bone_lengths_survive_any_pose(body):
    rng = np.random.default_rng(3)
    rest = body.rest_joints(random_betas(1)[0])
    _, places = body.forward_kinematics(np.zeros(3), random_local(rng, 5), rest)
    child, parent = np.arange(1, 52), body.parents[1:]
    length = np.linalg.norm(rest[child] - rest[parent], axis=-1)
    posed = np.linalg.norm(places[:, child] - places[:, parent], axis=-1)
    np.testing.assert_allclose(posed, np.tile(length, (5, 1)), atol=1e-9)


def test_moving_the_root_moves_the_body(body):
    rng = np.random.default_rng(4)
    betas, local = random_betas(1)[0], random_local(rng)
    rest = body.rest_joints(betas)
    here = body.skin(betas, *body.forward_kinematics(np.zeros(3), local, rest))
    turn, shift = random_local(rng, joints=1)[0], np.array([3.0, -2.0, 0.5])
    local[0] = turn @ local[0]
    there = body.skin(betas, *body.forward_kinematics(shift, local, rest))
    np.testing.assert_allclose(there, here @ turn.T + shift, atol=1e-9)


def test_a_batch_gives_what_its_rows_give(body):
    rng = np.random.default_rng(5)
    betas = random_betas(1)[0]
    rest = body.rest_joints(betas)
    local, hips = random_local(rng, 2, 3), rng.normal(size=(2, 3, 3))
    turns, places = body.forward_kinematics(hips, local, rest)
    markers = body.markers(betas, turns, places)
    assert markers.shape == (2, 3, 67, 3)
    one = body.markers(betas, *body.forward_kinematics(hips[1, 2], local[1, 2], rest))
    np.testing.assert_allclose(markers[1, 2], one, atol=1e-12)


def test_joints_beyond_those_given_stay_at_rest(body):
    rng = np.random.default_rng(6)
    rest = body.rest_joints(np.zeros(10))
    local = random_local(rng)
    local[22:] = np.eye(3)
    whole = body.forward_kinematics(np.zeros(3), local, rest)
    part = body.forward_kinematics(np.zeros(3), local[:22], rest)
    np.testing.assert_array_equal(whole[1], part[1])


def test_a_mirrored_pose_gives_mirrored_markers(body):
    rng = np.random.default_rng(7)
    betas, local = random_betas(1)[0], random_local(rng)
    names, marks = body.joint_names, body.marker_names
    bones = [names.index(skeleton.mirrored(n)) for n in names]
    others = [marks.index(landmarks.mirrored(n)) for n in marks]
    flip = np.diag([-1.0, 1.0, 1.0])
    rest = body.rest_joints(betas)
    one = body.markers(betas, *body.forward_kinematics(np.zeros(3), local, rest))
    other = body.markers(
        betas, *body.forward_kinematics(np.zeros(3), flip @ local[bones] @ flip, rest)
    )
    np.testing.assert_allclose(other[others] @ flip, one, atol=1e-4)


@pytest.mark.parametrize(
    "betas", [np.zeros(9), np.zeros((10, 1)), 0.0, np.full(10, np.nan), np.full(10, 5.1)]
)
def test_bad_betas_are_refused(betas):
    with pytest.raises(InvalidArgument) as caught:
        load_body("anny52", "male", "low").check_betas(betas)
    assert caught.value.field == "betas"
