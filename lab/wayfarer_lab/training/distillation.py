"""Smaller networks that answer as trained ones do (distillation; Hinton et al. 2015).

A step takes as long as its networks. Predictor and policy learn from recordings and in simulation,
for hours; smaller copies learn their answers to what is asked while they serve (`visited.py`),
within an hour. They learn nothing that their teachers do not know.
"""

from pathlib import Path
from typing import Literal

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor, nn
from torch.optim import Optimizer

from wayfarer.errors import InvalidArgument
from wayfarer.motion.policy import Gaussian, GoalPolicy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.spec import LATENT, SEED_FRAMES
from wayfarer_lab.training.predictor import marker_error, marker_terms
from wayfarer_lab.training.run import (
    TrainingRun,
    cosine_rate,
    load_goal_policy,
    load_predictor,
    read_run_config,
)
from wayfarer_lab.training.visited import Visited, load_visited

TEMPERATURES = (0.0, 1.0)
"""Range of the noise around the policy's mean; serving uses up to 0.7."""


class DistillationConfig(BaseModel):
    """Settings that both have."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    predictor: str = "runs/predictor_2f_rollout"  # run folders of the teachers
    policy: str = "runs/policy"
    steps: int = 10_000
    batch: int = 1024
    rate: float = 1e-3
    start_from: str = ""  # run folder whose weights to begin with
    seed: int = 0


class DistilledPredictorConfig(DistillationConfig):
    """A predictor that finds several frames at once."""

    seed_frames: Literal[2] = 2  # seeds as they are served
    floor_origin: bool = True  # as the teacher's
    at_once: Literal[1, 2, 4, 8] = 8
    velocity_weight: float = 3.0  # as in Eq. 1
    prior: float = 0.2  # share of latents that are noise alone, of the same temperatures


class DistilledPolicyConfig(DistillationConfig):
    """A narrower policy."""

    hidden: int = 128


class Teachers:
    """The trained networks, and their answers to what was asked."""

    def __init__(self, config: DistillationConfig, asked: Visited) -> None:
        self.predictor = load_predictor(Path(config.predictor), SEED_FRAMES).requires_grad_(False)
        self.policy = load_goal_policy(Path(config.policy)).requires_grad_(False)
        self.asked = asked
        self.answers = self._answers()

    @torch.no_grad()
    def _answers(self) -> Gaussian:
        found = []
        for begin in range(0, len(self.asked), 4096):
            some = self.asked[begin : begin + 4096]
            found.append(self.policy(some.seed, some.condition))
        return Gaussian(*(torch.cat(column) for column in zip(*found, strict=True)))

    def latents(self, rows: Tensor, noise: Tensor) -> Tensor:
        """Latents [B, 128] that the policy chose for questions `rows` [B], with this noise."""
        return drawn(Gaussian(*(v[rows] for v in self.answers)), self.asked[rows], noise)

    def futures(self, rows: Tensor, latents: Tensor) -> Tensor:
        """Markers [B, F, 201] that follow."""
        with torch.no_grad():
            return self.predictor.decode(self.asked.seed[rows], latents[:, None])[:, 0]


def drawn(distribution: Gaussian, asked: Visited, noise: Tensor) -> Tensor:
    """Latents [B, 128] as a step draws them."""
    return distribution.sample((noise + asked.manner)[:, None], asked.share)[:, 0]


def noises(count: int, generator: torch.Generator | None = None) -> Tensor:
    """Noise [B, 128] of random temperatures."""
    low, high = TEMPERATURES
    scale = low + (high - low) * torch.rand(count, 1, generator=generator)
    return scale * torch.randn(count, LATENT, generator=generator)


class PredictorDistillation:
    """The predictor learns the markers that its teacher finds for a seed and a latent."""

    def __init__(
        self, config: DistilledPredictorConfig, train: Visited, validation: Visited
    ) -> None:
        trained = read_run_config(Path(config.predictor))["floor_origin"]
        if trained != config.floor_origin:
            raise InvalidArgument(
                f"{config.predictor} was trained with floor_origin {trained}", "floor_origin"
            )
        torch.manual_seed(config.seed)
        self.config = config
        self.teachers, self.trial = Teachers(config, train), Teachers(config, validation)
        self.model = MarkerPredictor(config.seed_frames, at_once=config.at_once)
        if config.start_from:
            found = load_predictor(Path(config.start_from), config.seed_frames)
            if found.at_once != config.at_once:
                raise InvalidArgument(
                    f"{config.start_from} finds {found.at_once} frames at once", "at_once"
                )
            self.model.load_state_dict(found.state_dict())
        else:
            begin_as(self.model, self.teachers.predictor)
        self.optimizer = torch.optim.Adam(self.model.parameters(), lr=config.rate, fused=True)
        self.run: TrainingRun | None = None

    def update(self) -> dict[str, float]:
        """One optimiser step."""
        assert self.run is not None
        config, count = self.config, self.config.batch
        set_rate(self.optimizer, config, self.run.step)
        rows = torch.randint(len(self.teachers.asked), (count,))
        noise = noises(count)
        latents = self.teachers.latents(rows, noise)
        latents = torch.where(torch.rand(count, 1) < config.prior, noise, latents)
        truth = self.teachers.futures(rows, latents)
        guess = self.model.decode(self.teachers.asked.seed[rows], latents[:, None])[:, 0]
        places, changes = marker_terms(guess, truth)
        learn(self.optimizer, places + config.velocity_weight * changes)
        return {"places": float(places.detach()), "changes": float(changes.detach())}

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Distances from the teacher's markers on other people: millimetres, and mm per frame."""
        rows, noise = trial_of(self.trial.asked)
        latents = self.trial.latents(rows, noise)
        guess = self.model.decode(self.trial.asked.seed[rows], latents[:, None])[:, 0]
        return off(guess, self.trial.futures(rows, latents))


class PolicyDistillation:
    """The policy learns the distributions of its teacher."""

    def __init__(self, config: DistilledPolicyConfig, train: Visited, validation: Visited) -> None:
        torch.manual_seed(config.seed)
        self.config = config
        self.teachers, self.trial = Teachers(config, train), Teachers(config, validation)
        self.model = GoalPolicy(config.hidden)
        if config.start_from:
            known = load_goal_policy(Path(config.start_from))
            if known.condition.out_features != config.hidden:
                raise InvalidArgument(
                    f"{config.start_from} is {known.condition.out_features} wide", "hidden"
                )
            self.model.load_state_dict(known.state_dict())
        self.optimizer = torch.optim.Adam(self.model.parameters(), lr=config.rate, fused=True)
        self.run: TrainingRun | None = None

    def update(self) -> dict[str, float]:
        """One optimiser step."""
        assert self.run is not None
        set_rate(self.optimizer, self.config, self.run.step)
        rows = torch.randint(len(self.teachers.asked), (self.config.batch,))
        asked = self.teachers.asked[rows]
        mean, log_std = self.model(asked.seed, asked.condition)
        true = self.teachers.answers
        far = (mean - true.mean[rows]).square().mean()
        far = far + (log_std - true.log_std[rows]).square().mean()
        learn(self.optimizer, far)
        return {"latents": float(far.detach())}

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """On other people: how far the mean is off the teacher's, root of mean squares; and how far
        the markers are that the teachers' predictor makes of both policies' latents.
        """
        rows, noise = trial_of(self.trial.asked)
        asked = self.trial.asked[rows]
        guess = self.model(asked.seed, asked.condition)
        mean = (guess.mean - self.trial.answers.mean[rows]).square().mean().sqrt()
        made = self.trial.futures(rows, drawn(guess, asked, noise))
        truth = self.trial.futures(rows, self.trial.latents(rows, noise))
        return off(made, truth) | {"val/mean": float(mean)}


def begin_as(model: MarkerPredictor, teacher: MarkerPredictor) -> None:
    """All weights that both have; the last layer goes on as the teacher's first frame does."""
    known = teacher.state_dict()
    frames = torch.arange(1.0, model.at_once + 1)
    for name in ("output.1.weight", "output.1.bias"):
        first = known[name][: model.size]
        known[name] = torch.cat([number * first for number in frames])
    model.load_state_dict(known)
    model.uses_prior = teacher.uses_prior


def set_rate(optimizer: Optimizer, config: DistillationConfig, step: int) -> None:
    """The rate of a training's step."""
    for group in optimizer.param_groups:
        group["lr"] = cosine_rate(config.rate, step, config.steps)


def learn(optimizer: Optimizer, loss: Tensor) -> None:
    """One optimiser step."""
    optimizer.zero_grad()
    loss.backward()
    parameters = [p for group in optimizer.param_groups for p in group["params"]]
    nn.utils.clip_grad_norm_(parameters, 1.0)
    optimizer.step()


def trial_of(asked: Visited) -> tuple[Tensor, Tensor]:
    """Rows of questions and noise, always the same, on which a training is judged."""
    rows = torch.arange(0, len(asked), max(1, len(asked) // 4096))
    return rows, noises(len(rows), torch.Generator().manual_seed(1))


def off(guess: Tensor, truth: Tensor) -> dict[str, float]:
    """Mean distances of markers [B, F, 201] in mm, and of their changes in mm per frame."""
    error = guess - truth
    changes = torch.diff(error, dim=1, prepend=torch.zeros_like(error[:, :1]))
    return {
        "val/markers_mm": 10 * float(marker_error(error, torch.zeros_like(error)).mean()),
        "val/changes_mm": 10 * float(marker_error(changes, torch.zeros_like(error)).mean()),
    }


def distil_predictor(
    config: DistilledPredictorConfig, data: Path, folder: Path, minutes: float = float("inf")
) -> bool:
    """Train or resume in `folder`. True when all steps are done."""
    trainer = PredictorDistillation(config, *load_visited(data))
    trainer.run = TrainingRun(folder, config, trainer.model, trainer.optimizer)
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes)


def distil_policy(
    config: DistilledPolicyConfig, data: Path, folder: Path, minutes: float = float("inf")
) -> bool:
    """Train or resume in `folder`. True when all steps are done."""
    trainer = PolicyDistillation(config, *load_visited(data))
    trainer.run = TrainingRun(folder, config, trainer.model, trainer.optimizer)
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes)
