"""The paper's baseline of motion control, *g-CVAE* (Sec. 4.2): network, training and export.

The goal is a further condition of the generative model itself, in place of a policy over its
latents. The condition is the state of Eq. 3: the seed, and for each of its markers the direction
to the goal. All else is the marker predictor's: training starts from a trained one and continues
the same loss (Eq. 1) and over rollouts. A goal is
where the hips of the same recording will be some time later: goals in training can only come from
the data, which is the weakness that the paper sees in this baseline.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import torch
from torch import Tensor

from wayfarer.body.library import SHIPPED, load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.motion.frame import to_local
from wayfarer.motion.layers import Gru
from wayfarer.motion.policy import Condition, state
from wayfarer.motion.predictor import HIDDEN, SIZE, MarkerPredictor
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.quality import Sites
from wayfarer.spec import FPS, PRIMITIVE_FRAMES
from wayfarer_lab.training.dataset import Frames
from wayfarer_lab.training.export import round_to_half
from wayfarer_lab.training.graphs import ExportGraph, regressor_graph, step_graph
from wayfarer_lab.training.predictor import PredictorConfig, PredictorTrainer
from wayfarer_lab.training.regressor import load_regressor
from wayfarer_lab.training.run import (
    TrainingRun,
    load_predictor,
    load_weights,
    read_run_config,
    read_weights,
)


class GoalCvae(MarkerPredictor):
    """A marker predictor whose seeds are states [..., S, 402]."""

    def __init__(self, seed_frames: int, size: int = SIZE, at_once: int = 1) -> None:
        super().__init__(seed_frames, size, at_once)
        self.seed_encoder = Gru(2 * SIZE, HIDDEN)

    def start_from(self, predictor: MarkerPredictor) -> None:
        """Takes over a predictor's weights: at first, the goal is not looked at."""
        weights = predictor.state_dict()
        known = weights["seed_encoder.from_input.weight"]
        weights["seed_encoder.from_input.weight"] = torch.cat([known, torch.zeros_like(known)], 1)
        self.load_state_dict(weights)


class GoalCvaeStep(PrimitiveStep):
    """A step whose predictor is a `GoalCvae`: latents come from the prior N(0, I)."""

    def predict(self, seed: Tensor, asked: Condition, noise: Tensor, share: Tensor) -> Tensor:
        """As `PrimitiveStep.predict`; `share` means nothing here."""
        return self.predictor.decode(state(seed, asked.goal), noise)


class GoalCvaeConfig(PredictorConfig):
    """As a predictor's; `start_from` is a predictor's run."""

    representation: Literal["markers"] = "markers"
    goal_seconds: float = 8.0  # the farthest that a goal lies in the future


class GoalCvaeTrainer(PredictorTrainer):
    """Trains a predictor with the goal as input."""

    config: GoalCvaeConfig

    def network(self) -> GoalCvae:
        """The g-CVAE with a predictor's weights, when there is one to start from."""
        seed_frames = self.config.seed_frames
        if not self.config.start_from:
            return GoalCvae(seed_frames)
        predictor = load_predictor(Path(self.config.start_from), seed_frames)
        model = GoalCvae(seed_frames, at_once=predictor.at_once)
        model.start_from(predictor)
        return model

    def condition(self, frames: Frames, at: Tensor, seed: Tensor) -> Tensor:
        """The state of Eq. 3 [B, S, 402], the goal drawn from the way that the recording takes."""
        # between the primitive's last frame and `goal_seconds`, as far as the recording goes
        most = frames.run[at].clamp(max=round(self.config.goal_seconds * FPS)) - PRIMITIVE_FRAMES
        ahead = PRIMITIVE_FRAMES - 1 + (torch.rand(len(at)) * (most + 1)).long()
        goal = frames.hips[at + ahead] * torch.tensor([1.0, 1.0, 0.0])
        frame = frames.frame(at, self.config.floor_origin)
        return state(seed, to_local(frame, goal[:, None])[:, 0])


def train_goal_cvae(
    config: GoalCvaeConfig,
    train: Frames,
    validation: Frames,
    folder: Path,
    minutes: float = float("inf"),
) -> bool:
    """Trains or resumes in `folder`. True when all steps are done."""
    trainer = GoalCvaeTrainer(config, train, validation)
    trainer.run = TrainingRun(folder, config, trainer.model, trainer.optimizer)
    return trainer.run.drive(config.steps, trainer.update, trainer.validate, minutes)


def load_goal_cvae_graphs(run: Path, regressors: Mapping[str, Path]) -> dict[str, ExportGraph]:
    """Step and regressor graphs of a model folder; `regressors` are runs by gender."""
    floor_origin = read_run_config(run)["floor_origin"]
    predictor = round_to_half(load_weights(GoalCvae.fitting(read_weights(run), 2), run))
    graphs = {}
    for gender, trained in regressors.items():
        model = load_body(SHIPPED, gender)
        skin = marker_body(model)
        regressor = round_to_half(load_regressor(skin, trained))
        sites = Sites.from_names(model.marker_names)
        step = GoalCvaeStep(predictor, regressor, skin, sites, floor_origin=floor_origin).eval()
        graphs[f"regressor_{gender}.onnx"] = regressor_graph(regressor)
        graphs[f"step_{gender}.onnx"] = step_graph(step)
    return graphs
