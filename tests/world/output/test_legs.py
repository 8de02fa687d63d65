import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.world.fakes import stick_body
from tests.world.output.legwork import body, legs
from wayfarer.body.rotation import matrix_from_quaternion, quaternion_from_matrix
from wayfarer.errors import InvalidArgument
from wayfarer.spec import BETAS, POSED_JOINTS
from wayfarer.world.output.legs import ANKLES, HIPS, KNEES, measure_legs, pose_legs


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_joints_and_soles_are_those_of_the_skinned_body(seed):
    random = np.random.default_rng(seed)
    betas = random.uniform(-2, 2, BETAS)
    rotations = random.normal(size=(1, 3, POSED_JOINTS, 4)).astype(np.float32)
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    translation = random.normal(size=(1, 3, 3)).astype(np.float32)

    pose = pose_legs(legs(betas=betas), translation, rotations)
    turns, places = body().forward_kinematics(
        translation[0].astype(float),
        matrix_from_quaternion(rotations[0].astype(float)),
        body().rest_joints(betas),
    )
    markers = body().markers(betas, turns, places)[:, body().sole_markers]
    found = pose.soles[0].reshape(3, 8, 3)
    np.testing.assert_allclose(found, markers, atol=1e-5)
    for joints, place in ((HIPS, pose.hip), (KNEES, pose.knee), (ANKLES, pose.ankle)):
        off_root = places[:, joints] - places[:, :1]
        np.testing.assert_allclose(place[0], off_root, atol=1e-5)
    turn = quaternion_from_matrix(turns[:, ANKLES])
    same = np.abs((pose.ankle_turn[0] * turn).sum(-1))
    np.testing.assert_allclose(same, 1, atol=1e-5)


def test_a_body_without_the_four_markers_under_each_foot_is_refused():
    stick = stick_body()
    names = tuple(name.replace("LSOLE_TOE", "M0") for name in stick.marker_names)
    short = stick.__class__(**(vars(stick) | {"marker_names": names}))
    with pytest.raises(InvalidArgument, match="7 sole points; expected 8"):
        measure_legs(short, np.zeros(BETAS))
