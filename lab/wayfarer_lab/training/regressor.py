"""Train a body regressor (paper Sec. 3.2.2, Eq. 2) on poses re-skinned with random shapes."""

from pathlib import Path

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor

from wayfarer.body.model import BodyModel
from wayfarer.marker_bodies import marker_body
from wayfarer.motion.regressor import BodyRegressor
from wayfarer_lab.training.dataset import Frames, WindowSampler, random_betas
from wayfarer_lab.training.precision import half_precision
from wayfarer_lab.training.rotation import (
    matrix_from_quaternion,
    matrix_from_rotvec,
    sixd_from_matrix,
)
from wayfarer_lab.training.run import TrainingRun, cosine_rate, load_weights

PASS_SHARE = (0.25, 0.25, 0.5)
"""How often each of the regressor's passes is the one that learns."""

SURFACE = 128
"""Vertices of the skin, spread evenly over the mesh's numbering, that `surface_weight` looks at."""


class RegressorConfig(BaseModel):
    """What a regressor is trained with."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    gender: str
    steps: int = 12_000
    batch: int = 1024
    rate: float = 1e-3
    noise: float = 0.02  # metres: largest standard deviation of noise on input markers
    heading: float = 0.7  # radians: spread of headings; a primitive starts facing +Y
    through: bool = False  # gradients through all passes, the last one learns, as in the paper
    rotation_weight: float = 0.05  # weight of a 6D rotation term; with both 0, Eq. 2 alone
    surface_weight: float = 0.5  # weight of the skin between the markers
    start_from: str = ""  # run folder whose weights to begin with
    mix: dict[str, float] = {
        "walk": 0.25,
        "run": 0.1,
        "sideways": 0.1,
        "backward": 0.05,
        "start_stop": 0.1,
        "standing": 0.1,
        "other": 0.3,
    }  # share of draws, see dataset.group_of
    seed: int = 0


class RegressorTrainer:
    """Draws poses, skins them with random shapes, and learns the way back."""

    def __init__(
        self, config: RegressorConfig, train: Frames, validation: Frames, body: BodyModel
    ) -> None:
        torch.manual_seed(config.seed)
        self.config = config
        self.frames, self.validation = train, validation
        self.body = marker_body(body)
        self.surface = marker_body(body, _spread(len(body.bind_vertices), SURFACE))
        self.model = BodyRegressor(self.body, through=config.through)
        if config.start_from:
            load_weights(self.model, Path(config.start_from)).train()
        # skinning stays in float32: a bfloat16 metre is known to 4 mm
        half = half_precision()
        self.model.know = half(self.model.know)  # type: ignore[method-assign]
        self.model.correct = half(self.model.correct)  # type: ignore[method-assign]
        self.optimizer = torch.optim.Adam(self.model.parameters(), lr=config.rate, fused=True)
        self.sampler = WindowSampler(train, 1)
        self.run: TrainingRun | None = None

    def sample(
        self, frames: Frames, rows: Tensor, noise: float
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Poses at random headings: noisy markers, betas, true markers, true local rotations."""
        rotations = matrix_from_quaternion(frames.rotations[rows])
        right = rotations[:, 0, :2, 0]
        wanted = self.config.heading * (2 * torch.rand(len(rows)) - 1)
        turn = wanted - torch.atan2(right[:, 1], right[:, 0])
        zero = torch.zeros_like(turn)
        rotations[:, 0] = matrix_from_rotvec(torch.stack([zero, zero, turn], -1)) @ rotations[:, 0]
        betas = random_betas(len(rows))
        markers, _ = self.body(torch.zeros(len(rows), 3), rotations, betas)
        scale = noise * torch.rand(len(rows), 1, 1)
        noisy = markers + scale * torch.randn_like(markers)
        return noisy, betas, markers, rotations

    def update(self) -> dict[str, float]:
        """One optimiser step."""
        assert self.run is not None
        for group in self.optimizer.param_groups:
            group["lr"] = cosine_rate(self.config.rate, self.run.step, self.config.steps)
        with torch.no_grad():
            rows = self.sampler.draw(self.config.batch)
            noisy, betas, markers, truth = self.sample(self.frames, rows, self.config.noise)
            skin, _ = self.surface(torch.zeros(len(rows), 3), truth, betas)
        passes = None  # all of them
        if not self.config.through:  # one pass a step learns, the last one half of the time
            passes = int(torch.multinomial(torch.tensor(PASS_SHARE), 1)) + 1
        place, rotation = self.model(noisy[:, None], betas, passes)
        place, rotation = place[:, 0], rotation[:, 0]
        loss = (self.body(place, rotation, betas)[0] - markers).abs().mean()
        between = (self.surface(place, rotation, betas)[0] - skin).abs().mean()
        angle = (sixd_from_matrix(rotation) - sixd_from_matrix(truth)).abs().mean()
        self.optimizer.zero_grad()
        config = self.config
        (loss + config.surface_weight * between + config.rotation_weight * angle).backward()
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
        self.optimizer.step()
        return {
            "markers_l1": float(loss.detach()),
            "surface_l1": float(between.detach()),
            "rotations_l1": float(angle.detach()),
        }

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Mean marker error in mm on validation poses, random shapes, without and with noise."""
        generator_state = torch.get_rng_state()
        torch.manual_seed(1)
        index, _ = self.validation.starts(1)
        rows = index[:: max(1, len(index) // 2048)]
        result = {}
        for name, noise in (("val/marker_mm", 0.0), ("val/marker_noisy_mm", self.config.noise)):
            noisy, betas, markers, truth = self.sample(self.validation, rows, noise)
            place, rotation = (x[:, 0] for x in self.model(noisy[:, None], betas))
            found, _ = self.body(place, rotation, betas)
            result[name] = float(1000 * (found - markers).norm(dim=-1).mean())
            if not noise:
                skin, _ = self.surface(torch.zeros(len(rows), 3), truth, betas)
                made, _ = self.surface(place, rotation, betas)
                result["val/surface_mm"] = float(1000 * (made - skin).norm(dim=-1).mean())
        torch.set_rng_state(generator_state)
        return result


def _spread(size: int, count: int) -> list[int]:
    """`count` of `size` indices, evenly apart."""
    return torch.linspace(0, size - 1, count).long().tolist()


def train_regressor(
    config: RegressorConfig,
    train: Frames,
    validation: Frames,
    body: BodyModel,
    folder: Path,
    minutes: float = float("inf"),
) -> bool:
    """Train or resume in `folder`. True when all steps are done."""
    trainer = RegressorTrainer(config, train, validation, body)
    trainer.run = TrainingRun(folder, config, trainer.model, trainer.optimizer)
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes)
