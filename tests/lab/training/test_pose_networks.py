"""Both pose priors: from poses to latents and back, in any batch shape."""

import pytest
import torch

from wayfarer_lab.training.pose_networks import LATENT, PosePrior, VPoser
from wayfarer_lab.training.rotation import matrix_from_rotvec


@pytest.fixture(params=[PosePrior, lambda: VPoser(neurons=64)], ids=["ours", "vposer"])
def prior(request):
    torch.manual_seed(0)
    return request.param().eval()


def poses(*shape):
    return matrix_from_rotvec(torch.randn(*shape, 21, 3) * 0.3)


def test_a_pose_is_coded_the_same_alone_and_in_a_batch_of_frames(prior):
    given = poses(4, 3)
    with torch.no_grad():
        whole, one = prior.encode(given), prior.encode(given[2:3, 1:2])
    assert whole.mean.shape == whole.log_variance.shape == (4, 3, LATENT)
    assert torch.allclose(whole.mean[2, 1], one.mean[0, 0], atol=1e-5)
    assert torch.allclose(whole.log_variance[2, 1], one.log_variance[0, 0], atol=1e-5)


def test_what_is_decoded_is_rotations(prior):
    with torch.no_grad():
        rotations = prior.decode(torch.randn(5, LATENT))
    assert rotations.shape == (5, 21, 3, 3)
    eye = torch.eye(3).expand_as(rotations)
    assert torch.allclose(rotations @ rotations.transpose(-1, -2), eye, atol=1e-5)
    assert torch.allclose(torch.linalg.det(rotations), torch.ones(5, 21), atol=1e-5)


def test_latents_follow_the_pose_smoothly(prior):
    given = poses(8).requires_grad_()
    prior.encode(given).mean.square().sum().backward()
    assert torch.isfinite(given.grad).all() and given.grad.abs().max() > 0


def test_vposer_sees_poses_in_its_own_basis():
    """Bending both knees back turns about -X here (Z up, facing +Y) and about +X there."""
    seen = []
    network = VPoser(neurons=8).eval()
    network.encoder[0].register_forward_pre_hook(lambda _, inputs: seen.append(inputs[0]))
    bend = torch.zeros(1, 21, 3)
    bend[0, 3] = torch.tensor([-0.7, 0.2, 0.1])
    network.encode(matrix_from_rotvec(bend))
    assert torch.allclose(seen[0].view(21, 3)[3], torch.tensor([0.7, 0.1, 0.2]), atol=1e-5)
