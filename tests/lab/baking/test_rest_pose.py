"""The rotation from the modelled A-pose to the T-pose."""

import numpy as np
import pytest

from wayfarer.body import skeleton
from wayfarer.body.hands import relaxed
from wayfarer.body.library import load_body
from wayfarer.spec import GENDERS
from wayfarer_lab.baking.rest_pose import MIRROR, bind_to_rest

NAMES = skeleton.joint_names()


@pytest.fixture(params=GENDERS)
def body(request):
    return load_body("anny52", request.param)


def test_it_is_the_shipped_one(body):
    turns = bind_to_rest(NAMES, body.bind_joints)
    turns = relaxed(NAMES, body.bind_joints, turns)
    np.testing.assert_allclose(turns, body.bind_to_rest, atol=1e-5)


def test_turns_are_rotations_that_mirror(body):
    turns = bind_to_rest(NAMES, body.bind_joints)
    np.testing.assert_allclose(
        turns @ np.swapaxes(turns, -1, -2), np.tile(np.eye(3), (52, 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(turns), 1.0)
    for name in NAMES:
        other = turns[NAMES.index(skeleton.mirrored(name))]
        np.testing.assert_allclose(turns[NAMES.index(name)], MIRROR @ other @ MIRROR, atol=1e-12)


def test_trunk_stays_and_fingers_keep_their_curl(body):
    turns = dict(zip(NAMES, bind_to_rest(NAMES, body.bind_joints), strict=True))
    for name in ("pelvis", "spine1", "spine2", "spine3", "neck", "head", "left_collar"):
        np.testing.assert_array_equal(turns[name], np.eye(3))
    for name in NAMES[22:]:
        np.testing.assert_array_equal(turns[name], turns[name.split("_")[0] + "_wrist"])


def test_a_t_posed_skeleton_needs_no_turn_of_its_limbs(body):
    """Done twice, nothing moves: the result of the first turn is the T-pose already."""
    rest = body.rest_joints(np.zeros(10))
    turns = dict(zip(NAMES, bind_to_rest(NAMES, rest), strict=True))
    for name in ("left_wrist", "left_hip", "left_knee", "right_ankle"):
        np.testing.assert_allclose(turns[name], np.eye(3), atol=1e-5)
