"""Rollouts of predictors of body parameters, whose motion is known, and pictures of the worst."""

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from tests.lab.evaluation.fakes import upright_poses
from wayfarer.spec import FPS, PRIMITIVE_FRAMES
from wayfarer_lab.evaluation.direct import CAPTION, CELL, draw_poses, least_usual, roll_out_direct
from wayfarer_lab.evaluation.model_parts import Direct
from wayfarer_lab.evaluation.rollout import FrozenPoses, Rollout
from wayfarer_lab.training.representation import BodyParameters, HumorFeatures
from wayfarer_lab.training.rotation import matrix_from_rotvec, sixd_from_matrix

SPEED = 1.2
TURN = 0.02
"""Radians to the left in each frame."""


class Circle(nn.Module):
    """Goes ahead as it faces, and turns."""

    seed_frames, new_frames = 2, PRIMITIVE_FRAMES - 2

    def decode(self, seed: Tensor, latent: Tensor) -> Tensor:
        frame, frames = seed[:, -1].clone(), []
        turn = matrix_from_rotvec(torch.tensor([0.0, 0.0, TURN]))
        for _ in range(self.new_frames):
            frame = frame.clone()
            columns = frame[:, 3:9].reshape(-1, 2, 3) @ turn.T
            frame[:, 3:9] = columns.flatten(1)
            frame[:, :3] += torch.linalg.cross(torch.tensor([[0.0, 0.0, 1.0]]), columns[:, 0]) * (
                SPEED / FPS
            )
            frames.append(frame)
        return torch.stack(frames, 1)[:, None]


class Twisted(Circle):
    """Like Circle, but the spine of one body is twisted."""

    def decode(self, seed: Tensor, latent: Tensor) -> Tensor:
        made = super().decode(seed, latent)
        twist = sixd_from_matrix(matrix_from_rotvec(torch.tensor([0.0, 0.0, 2.5])))
        made[0, ..., 3 + 6 * 3 : 3 + 6 * 4] = twist
        return made


def rolled(model: nn.Module, kind: BodyParameters, gender: str = "female") -> Rollout:
    poses = FrozenPoses(gender, *upright_poses(2))
    return roll_out_direct(Direct(model, kind, True), poses, 40, torch.Generator())


@pytest.mark.parametrize("kind", [BodyParameters, HumorFeatures])
def test_bodies_go_on_as_their_own_parameters_say(kind: type[BodyParameters]) -> None:
    made = rolled(Circle(), kind())
    assert made.markers.shape == (2, 40, 67, 3) and made.carried.shape == (2, 5, 2, 67, 3)
    np.testing.assert_allclose(made.carried, made.reprojected(), atol=1e-6)
    step = np.diff(made.hips, axis=1)
    np.testing.assert_allclose(np.linalg.norm(step, axis=-1), SPEED / FPS, rtol=1e-3)
    heading = np.unwrap(np.arctan2(step[..., 1], step[..., 0]))
    np.testing.assert_allclose(np.diff(heading), TURN, atol=1e-3)
    yaw = 2 * np.arctan2(made.rotations[:, :, 0, 2], made.rotations[:, :, 0, 3])
    np.testing.assert_allclose(np.diff(yaw), TURN, atol=1e-3)
    lowest = made.markers[..., 2].min(-1)
    np.testing.assert_allclose(lowest, lowest[0, 0], atol=1e-4)
    assert abs(lowest[0, 0]) < 1e-4, "soles on the floor, as at the start"


def usual(rotations: np.ndarray) -> np.ndarray:
    """The score of a pose prior that knows only the spine's rest."""
    return np.abs(rotations[:, 3, 3])


def test_the_least_usual_poses_come_first() -> None:
    poses = FrozenPoses("female", *upright_poses(2))
    found = least_usual([(poses, rolled(Twisted(), BodyParameters()))], usual, 5)
    assert [pose["usual"] for pose in found] == [pytest.approx(0.315, abs=2e-3), 1.0]
    assert len(least_usual([(poses, rolled(Twisted(), BodyParameters()))], usual, 1)) == 1
    straight = least_usual([(poses, rolled(Circle(), BodyParameters()))], usual, 5)
    sheet = np.array(draw_poses({"good": straight, "bad": found})).astype(int)
    assert sheet.shape == (2 * (CAPTION + CELL[1]), 2 * CELL[0], 3)
    bodies = sheet.reshape(2, CAPTION + CELL[1], 2, CELL[0], 3)[:, CAPTION:]
    good, bad = bodies.transpose(0, 2, 1, 3, 4)
    assert np.abs(bad[0] - good[0]).mean() > 3 * np.abs(bad[1] - good[1]).mean()
