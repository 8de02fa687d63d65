import numpy as np
import pytest
import torch

from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer_lab.training.rotation import matrix_from_rotvec


@pytest.mark.parametrize("gender", ["male", "female"])
def test_equals_the_numpy_body(gender):
    """Two implementations, one body: torch for training and graphs, numpy for the service."""
    body = load_body("anny52", gender)
    torch.manual_seed(0)
    local, place = matrix_from_rotvec(torch.randn(5, 22, 3) * 0.5), torch.randn(5, 3)
    betas = torch.randn(5, 10)
    markers, joints = marker_body(body)(place, local, betas)
    for i in range(5):
        shape = betas[i].double().numpy()
        turns, places = body.forward_kinematics(
            place[i].numpy(), local[i].numpy(), body.rest_joints(shape)
        )
        difference = np.abs(body.markers(shape, turns, places) - markers[i].numpy()).max(-1)
        assert difference.max() < 2e-3  # torch leaves fingers as modelled
        assert (difference > 1e-5).sum() <= 6
        assert np.abs(places[:22] - joints[i].numpy()).max() < 1e-5


def test_gradients_reach_pose_place_and_shape():
    skin = marker_body(load_body("anny52", "female"))
    leaves = [torch.zeros(1, 3), torch.zeros(1, 22, 3), torch.zeros(1, 10)]
    place, turn, betas = (leaf.requires_grad_() for leaf in leaves)
    markers, _ = skin(place, matrix_from_rotvec(turn), betas)
    markers.square().sum().backward()
    assert all(leaf.grad.abs().sum() > 0 for leaf in (place, turn, betas))


def test_the_t_pose_needs_no_kinematics():
    skin = marker_body(load_body("anny52", "male"))
    torch.manual_seed(0)
    betas = torch.randn(4, 10)
    nowhere, unturned = torch.zeros(4, 3), torch.eye(3).expand(4, 22, 3, 3)
    markers, _ = skin(nowhere, unturned, betas)
    assert (skin.resting(betas).transpose(1, 2) - markers).abs().max() < 1e-5
