import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfarer_lab.training import rotation as r


def random_matrices(seed: int, count: int = 64) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return r.matrix_from_6d(torch.randn(count, 6, generator=generator, dtype=torch.float64))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_matrices_are_proper_rotations(seed):
    m = random_matrices(seed)
    eye = torch.eye(3, dtype=m.dtype).expand_as(m)
    assert torch.allclose(m @ m.transpose(-1, -2), eye, atol=1e-9)
    assert torch.allclose(torch.linalg.det(m), torch.ones(len(m), dtype=m.dtype))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_conversions_return_where_they_began(seed):
    m = random_matrices(seed)
    assert torch.allclose(r.matrix_from_6d(r.sixd_from_matrix(m)), m, atol=1e-9)
    assert torch.allclose(r.matrix_from_quaternion(r.quaternion_from_matrix(m)), m, atol=1e-9)
    assert torch.allclose(r.matrix_from_rotvec(r.rotvec_from_matrix(m)), m, atol=1e-6)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_half_turns_keep_their_axis(axis):
    """The pivot w vanishes there, which is where naive conversions divide by zero."""
    vector = torch.zeros(3, dtype=torch.float64)
    vector[axis] = torch.pi
    quaternion = r.quaternion_from_matrix(r.matrix_from_rotvec(vector))
    expected = torch.zeros(4, dtype=torch.float64)
    expected[axis] = 1
    assert torch.allclose(quaternion.abs(), expected, atol=1e-5)


def test_quarter_turn_about_z_takes_x_to_y():
    m = r.matrix_from_rotvec(torch.tensor([0.0, 0.0, torch.pi / 2]))
    assert torch.allclose(m @ torch.tensor([1.0, 0, 0]), torch.tensor([0.0, 1, 0]), atol=1e-6)
    q = r.quaternion_from_matrix(m)
    assert torch.allclose(q, torch.tensor([0.0, 0.0, 0.5**0.5, 0.5**0.5]), atol=1e-6)


def test_rotvec_of_zero_is_identity_with_finite_gradient():
    v = torch.zeros(3, requires_grad=True)
    m = r.matrix_from_rotvec(v)
    m.sum().backward()
    assert torch.allclose(m, torch.eye(3), atol=1e-6)
    assert torch.isfinite(v.grad).all()


def test_no_rotation_is_a_zero_rotvec_with_finite_gradient():
    m = torch.eye(3).requires_grad_()
    v = r.rotvec_from_matrix(m)
    v.sum().backward()
    assert torch.equal(v.detach(), torch.zeros(3))
    assert torch.isfinite(m.grad).all()
