"""Networks that know one motion: an upright T-pose that glides forward at `SPEED`."""

import torch
from torch import Tensor, nn

from tests.lab.evaluation.recordings import SPEED
from wayfarer.engines.torch.marker_bodies import load_marker_bodies
from wayfarer.motion.marker_body import MarkerBody, Shaped
from wayfarer.motion.policy import Condition, Gaussian
from wayfarer.motion.predictor import Posterior
from wayfarer.motion.regressor import Pose
from wayfarer.spec import BETAS, FPS, GENDERS, LATENT, MARKERS, POSED_JOINTS, PRIMITIVE_FRAMES
from wayfarer_lab.evaluation.model_parts import Parts


class Glide(nn.Module):
    """Predicts the seed's last frame, moved on; marker 0 may part from the body meanwhile."""

    def __init__(self, seed_frames: int, speed: float = SPEED, parting: float = 0.0) -> None:
        super().__init__()
        self.seed_frames, self.new_frames = seed_frames, PRIMITIVE_FRAMES - seed_frames
        self.speed, self.parting = speed, parting

    def decode(self, seed: Tensor, latent: Tensor) -> Tensor:
        step = torch.zeros(MARKERS, 3)
        step[:, 1] = self.speed / FPS
        step[0, 0] = self.parting / self.new_frames
        time = torch.arange(1, self.new_frames + 1)[:, None]
        future = seed[:, None, -1:] + time * step.flatten()
        return future.expand(-1, latent.shape[1], -1, -1)


class Upright(nn.Module):
    """Finds where a T-pose stands that has the mean of the given markers."""

    def __init__(self, body: MarkerBody) -> None:
        super().__init__()
        self.body = body
        self.off = torch.zeros(3)  # error put into every place

    def forward(self, markers: Tensor, betas: Tensor) -> tuple[Tensor, Tensor]:
        turns = torch.eye(3).expand(*markers.shape[:-2], POSED_JOINTS, 3, 3)
        origin = torch.zeros(*markers.shape[:-2], 3)
        upright, _ = self.body.skin(self.body.shaped(betas), origin, turns)
        return (markers - upright).mean(-2) + self.off, turns

    def solve(self, markers: Tensor, betas: Tensor, shape: Shaped) -> Pose:
        place, turns = self(markers, betas)
        return Pose(place.permute(2, 1, 0), turns.permute(3, 4, 2, 1, 0))


class Prior(nn.Module):
    """A policy that wants what the prior gives."""

    def forward(self, seed: Tensor, condition: Condition) -> Gaussian:
        return Gaussian(torch.zeros(len(seed), LATENT), torch.zeros(len(seed), LATENT))


class UsualNearRest(nn.Module):
    """A pose prior to which the T-pose is the most usual of all."""

    def encode(self, rotations: Tensor) -> Posterior:
        turned = (rotations - torch.eye(3)).flatten(-3)
        return Posterior(turned, torch.zeros_like(turned))


def known_parts(**changed: object) -> Parts:
    bodies = load_marker_bodies()
    given = {
        "predictors": {"ro-1f": Glide(1), "ro-2f": Glide(2)},
        "regressors": {gender: Upright(bodies[gender]) for gender in GENDERS},
        "policy": Prior(),
        "pose_prior": UsualNearRest(),
        "floor_origin": True,
    }
    return Parts(**(given | changed))


def upright_poses(count: int) -> tuple[Tensor, Tensor]:
    """Rotations [count, 22, 4] of T-poses and their betas [count, 10]."""
    return torch.tensor([0.0, 0, 0, 1]).expand(count, POSED_JOINTS, 4), torch.zeros(count, BETAS)
