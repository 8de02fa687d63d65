"""Manners are what people differ in who go the same way, whoever's body it is."""

from dataclasses import replace

import pytest
import torch

from tests.lab.training.fakes import walking_frames
from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.spec import GENDERS, MANNER
from wayfarer_lab.training.manners import MOST, measured, recorded
from wayfarer_lab.training.rotation import (
    matrix_from_quaternion,
    matrix_from_rotvec,
    quaternion_from_matrix,
)

LEFT_SHOULDER = 16


@pytest.fixture(scope="module")
def bodies():
    return [marker_body(load_body("anny52", gender)) for gender in GENDERS]


def people(clips=12):
    """Walkers in circles whose left arm is raised by 0, 20, 40 … degrees, a clip of each gender for
    each angle.
    """
    frames = walking_frames(clips=1, length=90)
    frames = replace(
        frames,
        **{k: v.repeat(clips, *(1,) * (v.dim() - 1)) for k, v in vars(frames).items()},
    )
    clip = torch.arange(len(frames.run)) // 90
    raised = torch.zeros(len(clip), 3)
    raised[:, 1] = clip // 2 * torch.pi / 9
    turn = matrix_from_rotvec(raised) @ matrix_from_quaternion(frames.rotations[:, LEFT_SHOULDER])
    frames.rotations[:, LEFT_SHOULDER] = quaternion_from_matrix(turn)
    return replace(frames, gender=clip % 2), clip


def test_what_tells_people_apart_is_found_and_spread_as_draws(bodies):
    frames, clip = people()
    shown = recorded(measured(frames, bodies), frames, bodies)
    assert shown.shape == (len(clip), MANNER) and shown.abs().max() <= MOST
    first = torch.stack([shown[clip // 2 == angle, 0].mean() for angle in range(6)])
    order = first.diff() * torch.sign(first[-1] - first[0])
    assert (order > 0).all(), "the arm is what differs, so the first number tells it"
    assert torch.allclose(shown[:, 0].mean(), torch.zeros(()), atol=0.2)
    assert torch.allclose(shown[:, 0].std(), torch.ones(()), atol=0.2)
    assert torch.equal(shown[75::90], shown[89::90]), "the end of a clip is not of the next one"


def test_a_stretch_that_is_shorter_than_a_window_has_no_manner(bodies):
    frames, clip = people(clips=3)
    short = replace(frames, run=torch.where(clip == 1, frames.run.clamp(max=20), frames.run))
    shown = recorded(measured(frames, bodies), short, bodies)
    assert not shown[clip == 1].any() and shown[clip == 0].any() and shown[clip == 2].any()


def test_people_who_act_do_not_say_what_is_usual(bodies):
    frames, clip = people()
    acted = replace(frames, acted=clip >= 6)
    shown = recorded(measured(acted, bodies), frames, bodies)[:, 0]
    natural = shown[clip < 6]
    assert natural.std() == pytest.approx(1, abs=0.2)
    assert (shown[clip == 11].mean() - natural.mean()).abs() > 1.5


def test_it_does_not_touch_the_random_numbers_of_a_training(bodies):
    frames, _ = people(clips=2)
    torch.manual_seed(3)
    measured(frames, bodies)
    after = torch.rand(3)
    torch.manual_seed(3)
    assert torch.equal(after, torch.rand(3))
