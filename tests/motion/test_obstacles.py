"""Obstacles near an agent: distances computed by hand."""

import math

import pytest
import torch

from wayfarer.motion.frame import canonical_frame
from wayfarer.motion.obstacles import EVERY, MARGIN, intrusion, localised, no_obstacles
from wayfarer.spec import FPS, NEW_FRAMES, OBSTACLES

FRAMES = 1 + NEW_FRAMES
SECONDS = NEW_FRAMES / FPS


def near(*obstacles):
    """[1, O, 7] with the rest none."""
    found = no_obstacles(1)
    for number, values in enumerate(obstacles):
        found[0, number] = torch.tensor(values)
    return found


def still(*points):
    """Markers [1, F, M, 3] that stay."""
    return torch.tensor([[(*p, 1.0) for p in points]]).expand(FRAMES, -1, -1)[None]


@pytest.mark.parametrize(
    ("obstacle", "expected"),
    [
        ((-1.0, 0.04, 1.0, 0.04, 0.0, 0.0, 0.0), MARGIN - 0.04),  # beside a wall
        ((0.05, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0), MARGIN - 0.05),  # before its end
        ((0.0, 0.3, 0.0, 0.3, 0.0, 0.0, 0.25), MARGIN - 0.05),  # beside a post
        ((0.0, 0.1, 0.0, 0.1, 0.0, 0.0, 0.25), MARGIN + 0.15),  # within it
        ((0.0, 0.3, 0.0, 0.3, 0.0, 0.0, 0.1), 0.0),
        ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0), 0.0),  # none
    ],
)
def test_depth_is_what_is_missing_of_the_margin(obstacle, expected):
    assert intrusion(still((0.0, 0.0)), near(obstacle)).item() == pytest.approx(expected, abs=1e-5)


def test_the_deepest_marker_in_the_nearest_obstacle_counts():
    wall, post = (-1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0), (5.0, 5.0, 5.0, 5.0, 0.0, 0.0, 0.05)
    points = still((0.0, 0.08), (3.0, 3.0), (5.0, 5.03))
    assert intrusion(points, near(wall, post)).item() == pytest.approx(MARGIN + 0.02, abs=2e-3)


def test_an_obstacle_that_comes_nearer_counts_when_it_is_there():
    speed = 1.0
    coming = (0.0, 0.2, 0.0, 0.2, 0.0, -speed, 0.0)
    seen = torch.arange(EVERY, FRAMES, EVERY) / FPS
    expected = (MARGIN - (0.2 - speed * seen)).clamp(min=0).mean().item()
    assert expected > 0
    assert intrusion(still((0.0, 0.0)), near(coming)).item() == pytest.approx(expected, abs=1e-4)


def test_it_is_the_same_seen_from_any_frame():
    turn = math.radians(70)
    hips = torch.tensor([[3.0, -2.0, 0.9]])
    rotation = torch.tensor(
        [[math.cos(turn), -math.sin(turn), 0.0], [math.sin(turn), math.cos(turn), 0.0], [0, 0, 1]]
    )
    frame = canonical_frame(hips, rotation[None])
    world = near((3.0, -1.9, 4.0, -1.9, 0.3, -0.4, 0.02), (2.9, -2.5, 2.9, -2.5, 0.0, 1.0, 0.3))
    points = still((3.05, -2.0), (2.9, -2.1))
    local = (points - frame.origin[:, None, None]) @ frame.rotation[:, None]
    seen = intrusion(local, localised(frame, world))
    assert seen.item() == pytest.approx(intrusion(points, world).item(), abs=1e-5)
    assert seen.item() > 0.02


def test_nothing_near_costs_nothing():
    assert no_obstacles(3).shape == (3, OBSTACLES, 7)
    assert intrusion(still((0.0, 0.0)), no_obstacles(1)).item() == 0
