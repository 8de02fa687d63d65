"""The g-CVAE: at first a marker predictor, but one that can look at the goal."""

import pytest
import torch

from wayfarer.motion.goal_cvae import GoalCvae
from wayfarer.motion.policy import state
from wayfarer.motion.predictor import MarkerPredictor

ROWS, CANDIDATES = 3, 2


@pytest.fixture
def seed() -> torch.Tensor:
    return torch.randn(ROWS, 2, 201, generator=torch.Generator().manual_seed(0))


@pytest.fixture
def latent() -> torch.Tensor:
    return torch.randn(ROWS, CANDIDATES, 128, generator=torch.Generator().manual_seed(1))


def goal(x: float) -> torch.Tensor:
    return torch.tensor([x, 5.0, 0.0]).expand(ROWS, 3)


def test_it_begins_as_the_predictor_it_starts_from(seed, latent):
    predictor, model = MarkerPredictor(2), GoalCvae(2)
    model.start_from(predictor)
    with torch.no_grad():
        told = state(seed, goal(1.0))
        assert torch.allclose(model.decode(told, latent), predictor.decode(seed, latent), atol=1e-6)
        future = torch.randn(ROWS, 8, 201)
        posterior, known = model.encode(told, future), predictor.encode(seed, future)
        assert torch.allclose(posterior.mean, known.mean, atol=1e-6)


def test_it_can_look_at_the_goal(seed, latent):
    model = GoalCvae(2)
    with torch.no_grad():
        left, right = (model.decode(state(seed, goal(x)), latent) for x in (-5.0, 5.0))
    assert left.shape == (ROWS, CANDIDATES, 8, 201)
    assert not torch.allclose(left, right, atol=1e-3)


def test_the_state_holds_unit_vectors_to_the_goal(seed):
    made = state(seed, goal(1.0))
    assert torch.equal(made[..., :201], seed)
    ways = made[..., 201:].unflatten(-1, (67, 3))
    assert torch.allclose(ways.norm(dim=-1), torch.ones(()), atol=1e-4)
    first = torch.tensor([1.0, 5.0, 0.0]) - seed[0, 1, :3]
    assert torch.allclose(ways[0, 1, 0], first / first.norm(), atol=1e-4)
