import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfarer.motion.frame import canonical_frame, to_local, to_world
from wayfarer_lab.training.rotation import matrix_from_6d, matrix_from_rotvec


def random_state(seed: int):
    generator = torch.Generator().manual_seed(seed)
    hips = torch.randn(8, 3, generator=generator, dtype=torch.float64) * 5
    turn = matrix_from_6d(torch.randn(8, 6, generator=generator, dtype=torch.float64))
    points = torch.randn(8, 20, 3, generator=generator, dtype=torch.float64)
    return hips, turn, points


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.booleans())
def test_there_and_back_is_identity(seed, floor):
    hips, turn, points = random_state(seed)
    frame = canonical_frame(hips, turn, floor)
    assert torch.allclose(to_world(frame, to_local(frame, points)), points, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.floats(-3.1, 3.1))
def test_local_points_do_not_know_where_in_the_world_they_are(seed, angle):
    """Turning about Z and moving along the floor changes nothing in the canonical frame."""
    hips, turn, points = random_state(seed)
    yaw = matrix_from_rotvec(torch.tensor([0.0, 0.0, angle], dtype=torch.float64))
    shift = torch.tensor([3.0, -7.0, 0.0], dtype=torch.float64)
    here = to_local(canonical_frame(hips, turn), points)
    moved = canonical_frame(hips @ yaw.T + shift, yaw @ turn)
    assert torch.allclose(to_local(moved, points @ yaw.T + shift), here, atol=1e-8)


def test_axes_and_origin():
    """X from left to right hip, Z up, origin on the floor or at the hips."""
    turn = matrix_from_rotvec(torch.tensor([0.0, 0.0, torch.pi / 2]))
    hips = torch.tensor([1.0, 2.0, 0.9])
    right = hips + turn @ torch.tensor([0.1, 0.0, 0.0])
    on_floor = to_local(canonical_frame(hips, turn), torch.stack([hips, right]))
    assert torch.allclose(on_floor, torch.tensor([[0, 0, 0.9], [0.1, 0, 0.9]]), atol=1e-6)
    at_hips = to_local(canonical_frame(hips, turn, floor_origin=False), hips[None])
    assert torch.allclose(at_hips, torch.zeros(1, 3), atol=1e-6)
