import pytest
import torch

from tests.lab.training.walkers import starts
from wayfarer.errors import InvalidArgument


@pytest.mark.parametrize("kind", ["standing", "moving", "pose_prior"])
@pytest.mark.parametrize("frames", [1, 2])
def test_starts_are_at_the_origin_and_face_forward(kind, frames):
    start = starts(frames, **{kind: 1.0}).draw(5)
    assert start.hips.shape == (5, frames, 3)
    assert start.rotations.shape == (5, frames, 22, 3, 3)
    assert torch.allclose(start.hips[:, 0, :2], torch.zeros(5, 2), atol=1e-6)
    right = start.rotations[:, 0, 0, :, 0]
    assert torch.allclose(right, torch.tensor([1.0, 0, 0]).expand(5, 3), atol=1e-5)


def test_who_moves_at_the_start_moves_and_who_stands_does_not():
    def way(kind):
        hips = starts(2, **{kind: 1.0}).draw(8).hips
        return (hips[:, 1] - hips[:, 0]).norm(dim=-1)

    assert (way("moving") > 0.5 / 40 - 1e-5).all()  # the recordings glide at 0.5 m/s or faster
    assert (way("standing") == 0).all() and (way("pose_prior") == 0).all()


def test_kinds_are_drawn_by_their_shares_and_in_no_order():
    torch.manual_seed(0)
    start = starts(2, standing=1.0, moving=3.0).draw(400)
    moving = (start.hips[:, 1] != start.hips[:, 0]).any(-1)
    assert 0.65 < moving.float().mean() < 0.85
    assert 0.55 < moving[:100].float().mean() < 0.95


def test_an_unknown_kind_is_refused():
    with pytest.raises(InvalidArgument, match=r"hopping.*standing"):
        starts(2, hopping=1.0).draw(3)
