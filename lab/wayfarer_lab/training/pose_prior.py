"""Train the pose prior on single poses, and load it again (VPoser's role, paper Sec. 3.1)."""

import math
from pathlib import Path

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor

from wayfarer_lab.training.dataset import Poses, WindowSampler
from wayfarer_lab.training.pose_networks import PosePrior, VPoser
from wayfarer_lab.training.rotation import matrix_from_quaternion
from wayfarer_lab.training.run import TrainingRun, cosine_rate, load_weights
from wayfarer_lab.training.vposer import load_vposer


class PosePriorConfig(BaseModel):
    """Settings of the training of a pose prior."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    steps: int = 6000
    batch: int = 512
    rate: float = 1e-3
    kl_weight: float = 0.005
    mix: dict[str, float] = {
        "walk": 0.2,
        "run": 0.1,
        "sideways": 0.05,
        "backward": 0.05,
        "start_stop": 0.1,
        "turn": 0.1,
        "standing": 0.15,
        "other": 0.25,
    }  # share of draws, see dataset.group_of
    seed: int = 0


class PosePriorTrainer:
    """Draws poses and minimises a variational bound: ‖R - R^rec‖² per joint, and KL."""

    def __init__(self, config: PosePriorConfig, train: Poses, validation: Poses) -> None:
        torch.manual_seed(config.seed)
        self.config = config
        self.poses, self.validation = train, validation
        self.model = PosePrior()
        self.optimizer = torch.optim.Adam(self.model.parameters(), lr=config.rate, fused=True)
        self.sampler = WindowSampler(train, 1)
        self.run: TrainingRun | None = None

    def update(self) -> dict[str, float]:
        """One optimiser step."""
        assert self.run is not None
        for group in self.optimizer.param_groups:
            group["lr"] = cosine_rate(self.config.rate, self.run.step, self.config.steps)
        rows = self.sampler.draw(self.config.batch)
        rotations = matrix_from_quaternion(self.poses.rotations[rows, 1:])
        posterior = self.model.encode(rotations)
        guess = self.model.decode(posterior.sample())
        reconstruction = ((guess - rotations) ** 2).sum((-1, -2)).mean()
        kl = posterior.kl().mean()
        self.optimizer.zero_grad()
        (reconstruction + self.config.kl_weight * kl).backward()
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
        self.optimizer.step()
        return {"reconstruction": float(reconstruction.detach()), "kl": float(kl.detach())}

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """On validation poses: error of a joint in degrees, KL per latent, and what Eq. 8 sees.

        `val/mean_square` is the mean over latents of μ², `val/active` the latents that are used
        (KL over 0.01).
        """
        index, _ = self.validation.starts(1)
        rows = index[:: max(1, len(index) // 2048)]
        rotations = matrix_from_quaternion(self.validation.rotations[rows, 1:])
        posterior = self.model.encode(rotations)
        by_latent = 0.5 * (
            posterior.log_variance.exp() + posterior.mean**2 - 1 - posterior.log_variance
        )
        return {
            "val/degrees": float(angles(self.model.decode(posterior.mean), rotations).mean()),
            "val/kl": float(posterior.kl().mean()),
            "val/mean_square": float((posterior.mean**2).mean()),
            "val/active": float((by_latent.mean(0) > 0.01).sum()),
        }


def angles(a: Tensor, b: Tensor) -> Tensor:
    """Angle between rotations [..., 3, 3] in degrees. [...]"""
    # ‖A - B‖ = 2 √2 sin(angle / 2), which unlike the trace is exact for small angles
    half = ((a - b) ** 2).sum((-1, -2)).sqrt() / (2 * math.sqrt(2))
    return torch.rad2deg(2 * torch.asin(half.clamp(max=1)))


def train_pose_prior(
    config: PosePriorConfig,
    train: Poses,
    validation: Poses,
    folder: Path,
    minutes: float = float("inf"),
) -> bool:
    """Trains or resumes in `folder`. True when all steps are done."""
    trainer = PosePriorTrainer(config, train, validation)
    trainer.run = TrainingRun(folder, config, trainer.model, trainer.optimizer)
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes)


def load_pose_prior(path: Path) -> PosePrior | VPoser:
    """The prior of a run folder, or a user's VPoser checkpoint file. Raises ArtifactError."""
    return load_vposer(path) if path.is_file() else load_weights(PosePrior(), path)
