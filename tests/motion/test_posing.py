import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfarer.motion import posing
from wayfarer_lab.training.rotation import matrix_from_6d


def rotations(seed: int, *shape: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    sixd = torch.randn(*shape, 6, generator=generator, dtype=torch.float64)
    return matrix_from_6d(sixd)


def poses_last(matrices: torch.Tensor) -> torch.Tensor:
    return matrices.movedim((-2, -1), (0, 1))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_products_are_those_of_matrices(seed):
    a, b = rotations(seed, 4, 5), rotations(seed + 1, 4, 5)
    v = torch.randn(4, 5, 3, dtype=torch.float64)
    product = posing.compose(poses_last(a), poses_last(b))
    assert torch.allclose(product, poses_last(a @ b))
    turned = posing.turn(poses_last(a), v.movedim(-1, 0))
    assert torch.allclose(turned, (a @ v[..., None])[..., 0].movedim(-1, 0))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_conversions_return_where_they_began(seed):
    m = poses_last(rotations(seed, 6, 2))
    assert torch.allclose(posing.from_6d(posing.to_6d(m)), m, atol=1e-9)
    assert torch.allclose(posing.from_quaternion(posing.to_quaternion(m)), m, atol=1e-9)
    assert (posing.to_quaternion(m)[3] >= 0).all()


def test_vectors_of_no_length_stay_finite():
    zero = torch.zeros(3, 4, requires_grad=True)
    posing.from_6d(torch.cat([zero, zero])).sum().backward()
    assert torch.isfinite(posing.unit(zero)).all()
    assert zero.grad is not None and torch.isfinite(zero.grad).all()


def test_products_broadcast_over_joints_and_frames():
    one = poses_last(rotations(3, 1, 1, 5))  # one joint, one frame, five agents
    many = poses_last(rotations(4, 22, 8, 5))
    assert posing.compose(one, many).shape == (3, 3, 22, 8, 5)
    assert posing.turn(one, torch.randn(3, 22, 8, 5, dtype=torch.float64)).shape == (3, 22, 8, 5)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_half_turns_keep_their_axis(axis):
    matrix = -torch.eye(3, dtype=torch.float64)
    matrix[axis, axis] = 1
    expected = torch.zeros(4, dtype=torch.float64)
    expected[axis] = 1
    assert torch.allclose(posing.to_quaternion(matrix[..., None])[:, 0].abs(), expected)
