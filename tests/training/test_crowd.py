"""Agents in training: drawn from motion, asked for things, replaced when they break."""

import pytest
import torch

from tests.training.fakes import gliding_frames
from wayfarer.body.library import load_body
from wayfarer.terms import STAND, TURN, WALK, weights
from wayfarer.training.crowd import CrowdSampler
from wayfarer.training.dataset import marker_body
from wayfarer.training.tasks import ARRIVED, STANDING, TURNING, WALKING, Tasks, draw_tasks


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


def test_tasks_are_what_their_kind_says():
    torch.manual_seed(1)
    place = torch.randn(500, 2) * 5
    tasks = draw_tasks(place)
    speed = tasks.target_speed(place)
    walking, turning = tasks.kind == WALKING, tasks.kind == TURNING
    assert speed[walking].min() > 0.3
    assert speed[~walking].abs().max() == 0
    assert torch.allclose(tasks.facing[turning].norm(dim=-1), torch.ones(int(turning.sum())))
    assert tasks.facing[tasks.kind == STANDING].abs().max() == 0
    tables = torch.tensor([weights(t) for t in (WALK, STAND, TURN)])
    assert torch.equal(tasks.term_weights(), tables[tasks.kind])


def test_whoever_is_there_stands_there():
    torch.manual_seed(2)
    place = torch.zeros(400, 2)
    tasks = Tasks(
        kind=torch.full((400,), WALKING),
        goal=torch.tensor([ARRIVED / 2, 0.0, 0.0]).repeat(400, 1),
        speed=torch.ones(400),
        facing=torch.zeros(400, 2),
    )
    tasks.renew(place)
    same = tasks.goal[:, 0] == ARRIVED / 2
    assert same.float().mean() > 0.8
    assert (tasks.kind[same] == STANDING).all()
