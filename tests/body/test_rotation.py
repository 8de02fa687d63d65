import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.body.rotation import (
    GLTF_FROM_CORE,
    continuous_quaternions,
    gltf_quaternion,
    matrix_from_quaternion,
    quaternion_from_matrix,
    quaternion_from_rotvec,
    rotvec_from_quaternion,
)

vectors = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3).map(np.array)


@given(vectors)
def test_vector_quaternion_matrix_and_back(rotvec):
    quaternion = quaternion_from_rotvec(rotvec)
    matrix = matrix_from_quaternion(quaternion)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) > 0
    back = quaternion_from_matrix(matrix)
    assert back[3] >= 0
    np.testing.assert_allclose(matrix_from_quaternion(back), matrix, atol=1e-12)
    again = quaternion_from_rotvec(rotvec_from_quaternion(quaternion))
    np.testing.assert_allclose(matrix_from_quaternion(again), matrix, atol=1e-9)


@given(vectors)
def test_the_gltf_basis_turns_the_same_things(rotvec):
    quaternion = quaternion_from_rotvec(rotvec)
    seen = matrix_from_quaternion(gltf_quaternion(quaternion))
    expected = GLTF_FROM_CORE @ matrix_from_quaternion(quaternion) @ GLTF_FROM_CORE.T
    np.testing.assert_allclose(seen, expected, atol=1e-12)


def test_a_quarter_turn_about_up():
    turn = matrix_from_quaternion(quaternion_from_rotvec(np.array([0, 0, np.pi / 2])))
    np.testing.assert_allclose(turn @ [0, 1, 0], [-1, 0, 0], atol=1e-12)


def test_half_turns_and_none():
    for rotvec in ([np.pi, 0, 0], [0, -np.pi, 0], [0, 0, 0], [1e-12, 0, 0]):
        quaternion = quaternion_from_rotvec(np.array(rotvec, float))
        matrix = matrix_from_quaternion(quaternion)
        found = matrix_from_quaternion(quaternion_from_matrix(matrix))
        np.testing.assert_allclose(found, matrix, atol=1e-12)
        np.testing.assert_allclose(
            np.abs(rotvec_from_quaternion(quaternion)), np.abs(rotvec), atol=1e-9
        )


def test_signs_are_made_continuous_without_changing_the_rotation():
    rng = np.random.default_rng(0)
    smooth = quaternion_from_rotvec(np.linspace(0, 6, 50)[:, None, None] * [[0, 0, 1.0]])
    flipped = smooth * rng.choice([-1, 1], size=(50, 1, 1))
    found = continuous_quaternions(flipped)
    assert (np.sum(found[1:] * found[:-1], -1) > 0.9).all()
    np.testing.assert_allclose(np.abs(found), np.abs(smooth))
