"""Graphs for export: each network of a step on its own, and the whole step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from wayfarer.motion.policy import Condition, Gaussian, Policy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.primitive import PrimitiveStep, StepResult
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import BETAS, LATENT, MANNER, MARKERS, OBSTACLES, SEED_FRAMES
from wayfarer.terms import TERMS
from wayfarer_lab.training.rotation import matrix_from_rotvec, quaternion_from_matrix


@dataclass(frozen=True)
class ExportGraph:
    """A module to export: names and example inputs, and which axes vary."""

    module: nn.Module
    inputs: dict[str, Tensor]
    outputs: Sequence[str]
    batch: Mapping[str, tuple[str, ...]]  # input → names of its leading dynamic axes


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

    def __init__(self, policy: Policy) -> None:
        super().__init__()
        self.policy = policy

    def forward(
        self,
        seed: Tensor,
        goal: Tensor,
        target_speed: Tensor,
        facing: Tensor,
        term_weights: Tensor,
        manner: Tensor,
    ) -> tuple[Tensor, Tensor]:
        return self.policy(seed, Condition(goal, target_speed, facing, term_weights, manner))


def policy_graph(policy: Policy) -> ExportGraph:
    """Seed [N, 2, 201], canonical frame, and what is asked → mean and log σ [N, 128] of latents."""
    inputs = {
        "seed": torch.randn(3, SEED_FRAMES, MARKERS * 3),
        "goal": torch.randn(3, 3),
        "target_speed": torch.rand(3),
        "facing": nn.functional.normalize(torch.randn(3, 2), dim=-1),
        "term_weights": torch.rand(3, len(TERMS)),
        "manner": torch.randn(3, MANNER),
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


def step_inputs(agents: int, candidates: int, generator: torch.Generator) -> dict[str, Tensor]:
    """Random inputs of a step: noisy bodies anywhere, for parity only."""

    def normal(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator)

    offset = normal(agents, 1, 1, 3) * 20
    return {
        "seed_markers": normal(agents, SEED_FRAMES, MARKERS, 3) * 0.4 + offset,
        "seed_translation": normal(agents, SEED_FRAMES, 3) * 0.1 + offset[:, 0],
        "seed_rotations": nn.functional.normalize(normal(agents, SEED_FRAMES, 22, 4), dim=-1),
        "betas": normal(agents, BETAS),
        "goal": normal(agents, 3) * 10,
        "target_speed": torch.rand(agents, generator=generator) * 2,
        "facing": nn.functional.normalize(normal(agents, 2), dim=-1),
        "term_weights": torch.rand(agents, len(TERMS), generator=generator),
        "policy": torch.rand(agents, generator=generator),
        "noise": normal(agents, candidates, LATENT),
        "manner": normal(agents, MANNER),
        "obstacles": _obstacles(offset[:, 0, :, :2], generator),
    }


def _obstacles(places: Tensor, generator: torch.Generator) -> Tensor:
    """Moving lines [A, O, 7] near places [A, 1, 2]; half of them, of negative radius, are none."""
    numbers = torch.randn(len(places), OBSTACLES, 7, generator=generator) * 0.4
    numbers[..., :4] += places.repeat(1, 1, 2)
    return numbers


def step_graph(step: PrimitiveStep) -> ExportGraph:
    """The whole step, dynamic in agents and candidates."""
    inputs = step_inputs(3, 4, torch.Generator().manual_seed(0))
    batch = dict.fromkeys(inputs, ("agents",)) | {"noise": ("agents", "candidates")}
    return ExportGraph(step, inputs, StepResult._fields, batch)


def body_inputs(step: PrimitiveStep, agents: int, generator: torch.Generator) -> dict[str, Tensor]:
    """Seeds that are bodies: bent a little at random at every joint, moving at walking speed."""
    bend = torch.randn(agents, 1, 22, 3, generator=generator) * 0.2
    local = matrix_from_rotvec(bend).expand(-1, SEED_FRAMES, -1, -1, -1)
    place = torch.tensor([0.0, 0.0, 0.95]) + torch.tensor([[0.0, 0, 0], [0, 0.03, 0]])
    place = place.expand(agents, -1, -1)
    betas = torch.randn(agents, BETAS, generator=generator)
    with torch.no_grad():
        markers, _ = step.body(place, local, betas[:, None].expand(-1, SEED_FRAMES, -1))
    return {
        "seed_markers": markers,
        "seed_translation": place.contiguous(),
        "seed_rotations": quaternion_from_matrix(local).contiguous(),
        "betas": betas,
        "obstacles": _obstacles(place[:, :1, :2], generator),
    }
