"""Representations of a primitive's frames: markers, body parameters, HuMoR's features."""

import pytest
import torch

from tests.lab.training.fakes import gliding_frames, walking_frames
from wayfarer_lab.training.representation import (
    REPRESENTATIONS,
    BodyParameters,
    HumorFeatures,
    Markers,
    Whose,
)

FRAMES = walking_frames()
STARTS = torch.tensor([3, 70, 130])  # of both genders, three shapes
INDEX = STARTS[:, None] + torch.arange(10)


def test_canonical_windows_begin_above_the_origin():
    frames, starts = gliding_frames(), torch.tensor([5, 40])
    index = starts[:, None] + torch.arange(10)
    told = Markers().recorded(frames, index, frames.frame(starts, True))
    windows = told.markers.unflatten(-1, (-1, 3))
    moved = windows - windows[:, :1]
    assert torch.allclose(windows[0, 0], windows[1, 0], atol=1e-5)  # the cloud is rigid
    assert (moved[:, -1, :, 1] > 0).all() and moved[..., [0, 2]].abs().max() < 1e-5


@pytest.mark.parametrize("name", REPRESENTATIONS)
def test_recorded_features_stand_for_the_recorded_markers(name):
    kind = REPRESENTATIONS[name]()
    told = kind.recorded(FRAMES, INDEX, FRAMES.frame(STARTS, True))
    assert told.features.shape == (3, 10, kind.size)
    made = kind.markers(told.features, Whose.of(FRAMES, STARTS))
    assert torch.allclose(made, told.markers, atol=1e-5)


@pytest.mark.parametrize("name", REPRESENTATIONS)
def test_features_move_from_frame_to_frame(name):
    """The same stretch, computed in the frame of another primitive or moved there."""
    kind = REPRESENTATIONS[name]()
    before, after = FRAMES.frame(STARTS, True), FRAMES.frame(STARTS + 25, False)
    told = kind.recorded(FRAMES, INDEX, before).features
    wanted = kind.recorded(FRAMES, INDEX, after).features
    assert not torch.allclose(told, wanted, atol=0.1)
    assert torch.allclose(kind.moved(told, before, after), wanted, atol=2e-4)


def test_velocities_are_those_of_the_places_beside_them():
    kind = HumorFeatures()
    told = kind.recorded(FRAMES, INDEX, FRAMES.frame(STARTS, True)).features
    joints, velocities = kind.beside(told)
    assert joints.shape == (3, 10, 66) and velocities.shape == (3, 10, 72)
    hips, turns = kind.pose(told)
    assert torch.allclose(joints[..., :3], hips, atol=1e-6), "joint 0 are the hips"
    assert torch.allclose(velocities[..., :3], velocities[..., 6:9], atol=1e-4)
    assert torch.allclose(40 * (hips[:, 1:] - hips[:, :-1]), velocities[:, 1:, :3], atol=1e-4)
    flat = velocities[..., :2].norm(dim=-1)
    assert torch.allclose(flat, torch.tensor(1.5), atol=0.01), "a circle of 1 m, 1.5 rad/s"
    turned = turns[:, 1:, 0] @ turns[:, :-1, 0].transpose(-1, -2)
    cosine = (turned.diagonal(dim1=-2, dim2=-1).sum(-1) - 1) / 2
    spin = velocities[:, 1:, 3:6].norm(dim=-1) / 40
    assert torch.allclose(torch.cos(spin), cosine, atol=1e-4)


def test_gradients_reach_body_parameters():
    kind = BodyParameters()
    told = kind.recorded(FRAMES, INDEX, FRAMES.frame(STARTS, True)).features.requires_grad_()
    kind.markers(told, Whose.of(FRAMES, STARTS)).square().sum().backward()
    assert told.grad is not None and (told.grad.abs() > 1e-6).float().mean() > 0.9
