"""Train a body regressor (paper Sec. 3.2.2, Eq. 2) on poses re-skinned with random shapes."""

from pathlib import Path
from typing import NamedTuple

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor

from wayfarer.body.model import BodyModel
from wayfarer.body.skeleton import joint_names
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import ArtifactError
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.posing import to_rows
from wayfarer.motion.primitive import EVERY
from wayfarer.motion.regressor import NETWORKS, BodyRegressor, Estimate
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS
from wayfarer_lab.training.dataset import Frames, WindowSampler, random_betas
from wayfarer_lab.training.precision import half_precision
from wayfarer_lab.training.rotation import (
    matrix_from_quaternion,
    matrix_from_rotvec,
    sixd_from_matrix,
)
from wayfarer_lab.training.run import TrainingRun, cosine_rate, load_weights, read_weights

FRAMES = NEW_FRAMES // EVERY + 1
"""Frames of a window, `EVERY` apart: the frames that a step regresses."""

SURFACE = 128
"""Vertices of the skin, spread evenly over the mesh's numbering, that `surface_weight` looks at."""


SIDES = ("left", "right")
LEG = ("hip", "knee", "ankle", "foot")
ARM = ("collar", "shoulder", "elbow", "wrist")
LIMBS = tuple(
    [number for number, name in enumerate(joint_names()[:POSED_JOINTS]) if name.startswith(names)]
    for names in (
        *(tuple(f"{side}_{part}" for part in limb) for limb in (LEG, ARM) for side in SIDES),
        ("spine", "neck", "head"),
    )
)
"""Joints that stay together when poses are mixed."""


class RegressorConfig(BaseModel):
    """Settings of the training of a regressor."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    gender: str
    steps: int = 12_000
    batch: int = 1024
    rate: float = 1e-3
    noise: float = 0.02  # metres: largest standard deviation of noise on input markers
    heading: float = 0.7  # radians: spread of headings; a primitive starts facing +Y
    networks: int = NETWORKS  # one for each pass, or one for all of them, as in the paper
    varied: float = 0.5  # share of windows whose poses nobody took
    exchanged: float = 0.5  # share of their limbs that come from another recording
    bent: float = 0.2  # radians: largest standard deviation of what their joints are bent by
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


class Sample(NamedTuple):
    """Poses to be found: A bodies, F frames each."""

    noisy: Tensor  # [A, F, 67, 3] markers
    betas: Tensor  # [A, 10]
    markers: Tensor  # [A, F, 67, 3] the true ones
    skin: Tensor  # [A, F, `SURFACE`, 3]
    truth: Tensor  # [A, F, 22, 3, 3] local rotations


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
        self.model = BodyRegressor(self.body, config.networks, config.through)
        if config.start_from:
            load_weights(self.model, Path(config.start_from)).train()
        # skinning stays in float32: a bfloat16 metre is known to 4 mm
        self.model.correct = half_precision()(self.model.correct)  # type: ignore[method-assign]
        self.optimizer = torch.optim.Adam(self.model.parameters(), lr=config.rate, fused=True)
        self.sampler = WindowSampler(train, EVERY * (FRAMES - 1) + 1)
        self.run: TrainingRun | None = None

    def varied(self, rotations: Tensor) -> Tensor:
        """Poses [A, F, 22, 3, 3], some of which nobody took.

        Their markers are exact all the same. Without them the networks learn how the people of the
        training move, and are off by a third more on others.
        """
        count = len(rotations)
        some = torch.rand(count) < self.config.varied
        mixed = rotations.clone()
        for limb in LIMBS:
            taken = some & (torch.rand(count) < self.config.exchanged)
            others = torch.where(taken, torch.randperm(count), torch.arange(count))
            mixed[:, :, limb] = rotations[others][:, :, limb]
        scale = self.config.bent * torch.rand(count, 1, 1) * some[:, None, None]
        bent = matrix_from_rotvec(scale * torch.randn(count, POSED_JOINTS, 3))
        return mixed @ bent[:, None]

    def sample(self, rotations: Tensor, noise: float) -> Sample:
        """Windows of recorded `rotations` [A, F, 22, 3, 3] at random headings, on random bodies."""
        count = len(rotations)
        right = rotations[:, 0, 0, :2, 0]
        wanted = self.config.heading * (2 * torch.rand(count) - 1)
        turn = wanted - torch.atan2(right[:, 1], right[:, 0])
        zero = torch.zeros_like(turn)
        turned = matrix_from_rotvec(torch.stack([zero, zero, turn], -1))
        rotations = torch.cat([turned[:, None, None] @ rotations[:, :, :1], rotations[:, :, 1:]], 2)
        betas = random_betas(count)
        markers, skin = self.made(torch.zeros(count, FRAMES, 3), rotations, betas)
        scale = noise * torch.rand(count, FRAMES, 1, 1)
        noisy = markers + scale * torch.randn_like(markers)
        return Sample(noisy, betas, markers, skin, rotations)

    def made(self, place: Tensor, rotations: Tensor, betas: Tensor) -> tuple[Tensor, Tensor]:
        """Markers and skin of A bodies in F poses."""
        markers, _ = self.body.skin(self.body.shaped(betas), place, rotations)
        skin, _ = self.surface.skin(self.surface.shaped(betas), place, rotations)
        return markers, skin

    def find(self, sample: Sample) -> list[Estimate]:
        """The estimates of the passes."""
        shape = self.body.shaped(sample.betas)
        return self.model.estimates(sample.noisy, sample.betas, shape)

    def losses(self, found: Estimate, sample: Sample) -> Tensor:
        """Mean distances along the axes of markers, skin and 6D numbers. [3]"""
        place = to_rows(found.pose.hips.transpose(0, 1))
        rotations = to_rows(found.pose.rotations.permute(3, 2, 0, 1, 4))
        markers, skin = self.made(place, rotations, sample.betas)
        pairs = (
            (markers, sample.markers),
            (skin, sample.skin),
            (sixd_from_matrix(rotations), sixd_from_matrix(sample.truth)),
        )
        return torch.stack([(one - of[:, found.frames]).abs().mean() for one, of in pairs])

    def update(self) -> dict[str, float]:
        """One optimiser step."""
        assert self.run is not None
        for group in self.optimizer.param_groups:
            group["lr"] = cosine_rate(self.config.rate, self.run.step, self.config.steps)
        with torch.no_grad():
            starts = self.sampler.draw(self.config.batch // FRAMES)
            poses = self.varied(windows(self.frames, starts))
            sample = self.sample(poses, self.config.noise)
        estimates = self.find(sample)
        losses = [self.losses(e, sample) for e in estimates[-1 if self.config.through else 0 :]]
        loss, between, angle = torch.stack(losses).sum(0)
        self.optimizer.zero_grad()
        config = self.config
        (loss + config.surface_weight * between + config.rotation_weight * angle).backward()
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
        self.optimizer.step()
        found = losses[-1].detach()
        return dict(zip(("markers_l1", "surface_l1", "rotations_l1"), found.tolist(), strict=True))

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Mean errors in mm on validation poses, random shapes, without and with noise."""
        generator_state = torch.get_rng_state()
        torch.manual_seed(1)
        index, _ = self.validation.starts(EVERY * (FRAMES - 1) + 1)
        poses = windows(self.validation, index[:: max(1, len(index) // 512)])
        result = {}
        for name, noise in (("", 0.0), ("_noisy", self.config.noise)):
            sample = self.sample(poses, noise)
            found = self.find(sample)[-1].pose
            place = to_rows(found.hips.transpose(0, 1))
            turns = to_rows(found.rotations.permute(3, 2, 0, 1, 4))
            markers, skin = self.made(place, turns, sample.betas)
            off = (markers - sample.markers).norm(dim=-1)
            result[f"val/marker{name}_mm"] = float(1000 * off.mean())
            if not noise:
                off = (skin - sample.skin).norm(dim=-1)
                result["val/surface_mm"] = float(1000 * off.mean())
        torch.set_rng_state(generator_state)
        return result


def windows(poses: Frames, starts: Tensor) -> Tensor:
    """Local rotations [A, F, 22, 3, 3] of windows that begin at frames `starts` [A]."""
    return matrix_from_quaternion(poses.rotations[starts[:, None] + EVERY * torch.arange(FRAMES)])


def _spread(size: int, count: int) -> list[int]:
    """`count` of `size` indices, evenly apart."""
    return torch.linspace(0, size - 1, count).long().tolist()


def load_regressor(body: MarkerBody, folder: Path) -> BodyRegressor:
    """The regressor of a run. Raises ArtifactError."""
    weights = read_weights(folder)
    networks = {name.split(".")[1] for name in weights if name.startswith("networks.")}
    if not networks:
        raise ArtifactError(f"{folder}: its regressor is of an older version: train it again")
    model = BodyRegressor(body, len(networks))
    model.load_state_dict(weights)
    return model.eval()


def train_regressor(
    config: RegressorConfig,
    train: Frames,
    validation: Frames,
    body: BodyModel,
    folder: Path,
    minutes: float = float("inf"),
) -> bool:
    """Trains or resumes in `folder`. True when all steps are done."""
    trainer = RegressorTrainer(config, train, validation, body)
    trainer.run = TrainingRun(folder, config, trainer.model, trainer.optimizer)
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes)
