import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from wayfarer.body.library import load_body
from wayfarer_lab.training.mocap.fit import sole_points
from wayfarer_lab.training.mocap.kinematics import FrameKinematics


@pytest.mark.parametrize("gender", ["male", "female"])
def test_agrees_with_the_body_model(gender: str) -> None:
    body = load_body("anny52", gender)
    points, parts = sole_points(body)
    assert sorted(set(parts.tolist())) == [0, 1, 2, 3]
    kinematics = FrameKinematics(body, points)
    betas = np.linspace(-1.5, 1.5, 10)
    quaternions = Rotation.random(6 * 22, random_state=1).as_quat().reshape(6, 22, 4)
    local = Rotation.from_quat(quaternions.reshape(-1, 4)).as_matrix().reshape(6, 22, 3, 3)
    hips = np.random.default_rng(0).normal(size=(6, 3))
    world, wanted = body.forward_kinematics(hips, local, body.rest_joints(betas))
    offsets, seen = kinematics.shape(betas)

    def frames(array: np.ndarray) -> torch.Tensor:
        return torch.tensor(np.repeat(array[..., None], 6, -1), dtype=torch.float32)

    places, soles = kinematics(
        torch.tensor(hips.T, dtype=torch.float32),
        torch.tensor(quaternions.transpose(1, 2, 0), dtype=torch.float32),
        frames(offsets),
        frames(seen),
    )
    np.testing.assert_allclose(places.permute(2, 0, 1), wanted[:, :22], atol=1e-5)
    skin = body.skin(betas, world, wanted, points)
    np.testing.assert_allclose(soles.permute(2, 0, 1), skin, atol=1e-4)
