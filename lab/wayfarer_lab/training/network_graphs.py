"""The networks of a step as graphs of their own: predictor, policy, regressor."""

import torch
from torch import Tensor, nn

from wayfarer.motion.policy import Condition, Gaussian, GoalPolicy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import BETAS, LATENT, MARKERS, SEED_FRAMES
from wayfarer.terms import TERMS
from wayfarer_lab.training.graph import ExportGraph


class _Decode(nn.Module):
    """The predictor's decoder alone, one latent per row."""

    def __init__(self, predictor: MarkerPredictor) -> None:
        super().__init__()
        self.predictor = predictor

    def forward(self, seed: Tensor, latent: Tensor) -> Tensor:
        return self.predictor.decode(seed, latent[:, None])[:, 0]


def predictor_graph(predictor: MarkerPredictor) -> ExportGraph:
    """Seed [N, S, 201] and latent [N, 128] → future [N, F, 201], canonical frame."""
    inputs = {
        "seed": torch.randn(3, predictor.seed_frames, MARKERS * 3),
        "latent": torch.randn(3, LATENT),
    }
    return ExportGraph(
        _Decode(predictor), inputs, ("future",), {"seed": ("rows",), "latent": ("rows",)}
    )


class _Act(nn.Module):
    """The actor alone, on flat arguments."""

    def __init__(self, policy: GoalPolicy) -> None:
        super().__init__()
        self.policy = policy

    def forward(
        self, seed: Tensor, goal: Tensor, target_speed: Tensor, facing: Tensor, weights: Tensor
    ) -> tuple[Tensor, Tensor]:
        return self.policy(seed, Condition(goal, target_speed, facing, weights))


def policy_graph(policy: GoalPolicy) -> ExportGraph:
    """Seed [N, 2, 201], canonical frame, and what is asked → mean and log σ [N, 128] of latents."""
    inputs = {
        "seed": torch.randn(3, SEED_FRAMES, MARKERS * 3),
        "goal": torch.randn(3, 3),
        "target_speed": torch.rand(3),
        "facing": nn.functional.normalize(torch.randn(3, 2), dim=-1),
        "term_weights": torch.rand(3, len(TERMS)),
    }
    return ExportGraph(_Act(policy), inputs, Gaussian._fields, dict.fromkeys(inputs, ("rows",)))


class _Regress(nn.Module):
    """The regressor on flat markers."""

    def __init__(self, regressor: BodyRegressor) -> None:
        super().__init__()
        self.regressor = regressor

    def forward(self, markers: Tensor, betas: Tensor) -> tuple[Tensor, Tensor]:
        place, rotations = self.regressor(markers.unflatten(-1, (MARKERS, 3))[:, None], betas)
        return place[:, 0], rotations[:, 0]


def regressor_graph(regressor: BodyRegressor) -> ExportGraph:
    """Markers [N, 201] and betas [N, 10] → translation [N, 3], rotations [N, 22, 3, 3]."""
    inputs = {"markers": torch.randn(3, MARKERS * 3), "betas": torch.randn(3, BETAS)}
    batch = {"markers": ("rows",), "betas": ("rows",)}
    return ExportGraph(_Regress(regressor), inputs, ("translation", "rotations"), batch)
