"""The critic tells two sets of made-up walks apart, by how they move and not by where."""

import pytest
import torch
from torch import Tensor

from wayfarer.body.library import load_body
from wayfarer.spec import FPS
from wayfarer_lab.training.likeness import FRAMES, Critic, GaitFeatures

NAMES = load_body("anny52", "male").marker_names
FEATURES = GaitFeatures.from_names(NAMES)


def walks(count: int, bob: float, seed: int = 0) -> Tensor:
    """Rigid clouds [B, FRAMES, 67, 3] that glide to all sides and rise and fall by `bob` metres."""
    cloud = torch.randn(len(NAMES), 3, generator=torch.Generator().manual_seed(9))
    generator = torch.Generator().manual_seed(seed)
    cloud = cloud + 0.02 * torch.randn(count, len(NAMES), 3, generator=generator)
    time = torch.arange(FRAMES) / FPS
    phase = 6.28 * torch.rand(count, 1, generator=generator)
    height = 1 + bob / 2 * torch.sin(12 * time + phase)
    place = torch.stack([torch.zeros(count, FRAMES), 1.2 * time.expand(count, -1), height], -1)
    return cloud[:, None] + place[:, :, None]


def test_place_and_heading_do_not_matter():
    window = walks(3, 0.03)
    turned = torch.stack([-window[..., 1], window[..., 0], window[..., 2]], -1)
    moved = turned + torch.tensor([5.0, -3.0, 0.2])
    assert torch.allclose(FEATURES.of(window), FEATURES.of(moved), atol=1e-3)
    assert FEATURES.of(window).shape == (3, FEATURES.size, FRAMES - 1)


def test_speed_is_that_of_the_waist_over_the_window():
    assert torch.allclose(FEATURES.speed(walks(4, 0.03)), torch.tensor(1.2), atol=1e-4)


@pytest.mark.parametrize(("bob", "least", "most"), [(0.01, 0.9, 1.0), (0.04, 0.25, 0.75)])
def test_a_critic_learns_what_two_sets_of_walks_differ_in_and_only_that(bob, least, most):
    torch.manual_seed(0)
    critic = Critic(FEATURES.size)
    critic.fit(FEATURES.of(walks(64, 0.04)))
    optimizer = torch.optim.Adam(critic.parameters(), lr=1e-3, betas=(0.5, 0.9))
    for step in range(100, 180):
        people, made = walks(32, 0.04, seed=step), walks(32, bob, seed=2 * step)
        loss, _ = critic.loss(FEATURES.of(people), FEATURES.of(made))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    with torch.no_grad():
        real = critic(FEATURES.of(walks(64, 0.04, seed=2)))
        fake = critic(FEATURES.of(walks(64, bob, seed=3)))
    assert least <= (real[:, None] > fake[None]).float().mean() <= most


def test_the_verdict_has_a_slope_towards_the_markers_and_learning_has_none():
    critic, window = Critic(FEATURES.size), walks(4, 0.03).requires_grad_(True)
    features = FEATURES.of(window)
    (slope,) = torch.autograd.grad(critic(features).sum(), window, retain_graph=True)
    assert slope.abs().sum() > 0
    loss, _ = critic.loss(features, features)
    loss.backward()
    assert window.grad is None
    assert all(p.grad is not None for p in critic.parameters())
