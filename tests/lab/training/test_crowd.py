"""Agents in training: drawn from motion, asked for things, replaced when they break."""

import pytest
import torch

from tests.lab.training.fakes import gliding_frames
from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.spec import FPS
from wayfarer_lab.training.crowd import CrowdSampler


@pytest.fixture(scope="module")
def crowd():
    torch.manual_seed(0)
    return CrowdSampler(gliding_frames(), marker_body(load_body("anny52", "male"))).draw(32)


def test_bodies_stand_as_high_as_the_recorded_ones_whatever_their_shape(crowd):
    recorded = gliding_frames().markers[..., 2].amin()
    lowest = crowd.markers[..., 2].amin((-1, -2))
    assert torch.allclose(lowest, recorded.expand(32), atol=1e-4)
    assert crowd.translation[:, -1, 2].std() > 0.01  # shapes differ
    assert crowd.translation[:, 0, :2].abs().max() == 0


def test_sound_bodies_are_told_from_broken_ones(crowd):
    bad = crowd.detached()
    bad.markers, bad.translation = bad.markers.clone(), bad.translation.clone()
    bad.markers[3, 0, 0, 0] = torch.nan
    bad.markers[5, 1, 7] += 4.0
    bad.translation[9, :, 2] = 0.3
    assert not crowd.broken().any()
    assert torch.nonzero(bad.broken()).squeeze(-1).tolist() == [3, 5, 9]


def test_speed_and_facing_are_those_of_the_hips(crowd):
    moved = crowd.detached()
    moved.translation = moved.translation.clone()
    moved.translation[:, 1] = moved.translation[:, 0] + torch.tensor([0.03, 0.04, 0.5])
    assert torch.allclose(moved.speed, torch.full((32,), 0.05 * FPS), atol=1e-4)
    assert torch.allclose(crowd.facing.norm(dim=-1), torch.ones(32), atol=1e-5)
