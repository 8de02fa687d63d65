"""The whole step as a graph, and inputs on which torch and the graph are compared."""

import torch
from torch import Tensor, nn

from wayfarer.motion.primitive import PrimitiveStep, StepResult
from wayfarer.spec import BETAS, LATENT, MARKERS, OBSTACLES, SEED_FRAMES
from wayfarer.terms import TERMS
from wayfarer_lab.training.graph import ExportGraph
from wayfarer_lab.training.rotation import matrix_from_rotvec, quaternion_from_matrix


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
