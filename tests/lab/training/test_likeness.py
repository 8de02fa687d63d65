"""The critic finds recorded windows that go the same way, and learns what is not like them."""

from math import sin

import pytest
import torch

from tests.lab.training.fakes import gliding_frames, walking_frames
from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.motion.quality import Sites
from wayfarer.spec import FPS
from wayfarer_lab.training.likeness import PACK, Likeness, RecordedWindows
from wayfarer_lab.training.views import EVERY, TURN, joined

LENGTH = 33
SECONDS = (LENGTH - 1) / FPS


@pytest.fixture(scope="module")
def model():
    return load_body("anny52", "male")


@pytest.fixture(scope="module")
def likeness(model):
    torch.manual_seed(0)
    sites = Sites.from_names(model.marker_names)
    return Likeness(gliding_frames(), marker_body(model), sites, LENGTH, rate=1e-3)


def test_ways_are_seen_from_the_first_frame(model):
    """Walkers go in circles of 1 m to the left, at 1.5 rad/s, wherever they begin."""
    torch.manual_seed(0)
    recorded = RecordedWindows(walking_frames(), marker_body(model), LENGTH)
    turned = 1.5 * SECONDS
    ways = recorded.ways[:99].mean(0)  # hips swing by themselves, too
    assert float(recorded.ways[0, :2].norm()) == pytest.approx(2 * sin(turned / 4), abs=1e-3)
    assert float(ways[4]) == pytest.approx(TURN * turned, abs=0.1)


def test_recorded_windows_go_the_way_that_is_asked(likeness):
    ways = likeness.recorded.ways[[5, 500]]
    found = likeness.recorded.like(ways)
    assert found.markers.shape == (2, 1 + (LENGTH - 1) // EVERY, 67, 3)
    assert torch.allclose(found.ways(), ways, atol=0.05)
    lowest = likeness.recorded.frames.markers[..., 2].min()
    assert torch.allclose(found.markers[..., 2].amin((-1, -2)), lowest, atol=1e-4)


def test_it_learns_what_is_out_of_place(likeness):
    """Agents differ from recorded people by 30 cm at two markers only."""
    torch.manual_seed(1)
    off = torch.zeros(67, 3)
    off[[3, 40], 2] = 0.3
    everybody = torch.ones(24, dtype=torch.bool)
    right = []
    for _ in range(80):
        view = likeness.recorded.view(torch.randint(1000, (24,)))
        made = view._replace(markers=(view.markers + off).requires_grad_())
        verdict = likeness.judge(made, everybody)
        right.append(verdict.right)
    assert sum(right[-20:]) / 20 > 0.75 > sum(right[:5]) / 5 and verdict.mean > 0.5
    verdict.cost.sum().backward()
    slope = made.markers.grad.abs().mean((0, 1))
    assert slope[[3, 40], 2].mean() > 2 * slope.mean()
    assert all(p.grad is None or p.grad.isfinite().all() for p in likeness.critic.parameters())


def test_nobody_else_is_judged(likeness):
    view = likeness.recorded.view(torch.arange(7))
    rows = torch.tensor([True, False, True, True, False, False, False])
    cost = likeness.judge(view, rows).cost
    assert (cost[~rows] == 0).all() and (cost > 0).sum() == PACK, "an odd one is left out"
    assert likeness.judge(view, ~rows & rows).cost.sum() == 0


def test_slopes_are_those_of_what_was_predicted(likeness, model):
    frames = gliding_frames()
    hips, rotations = frames.hips[None, :3], frames.rotations[None, :3]
    betas = torch.zeros(1, 10)
    predicted = torch.randn(1, 3, 67, 3, requires_grad=True)
    view = likeness.view(hips, rotations, betas, predicted)
    known = likeness.view(hips, rotations, betas)
    assert torch.allclose(view.markers, known.markers, atol=1e-5)
    joined([view, known]).markers.sum().backward()
    assert (predicted.grad == 1).all()
