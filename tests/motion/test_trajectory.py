"""Requests to a body, in the canonical frame of its seed."""

import math

import pytest
import torch

from wayfarer.motion.trajectory import BRAKE, CREEP, EASE, HORIZONS, SURGE, TURN_MOST, asked_of
from wayfarer.spec import FPS, MARKERS

SECONDS = [h / FPS for h in HORIZONS]


def seed_at(velocity=(0.0, 0.0), frames=2):
    """Markers that move together over the origin, m/s."""
    moved = torch.tensor([*velocity, 0.0]) / FPS
    cloud = torch.randn(MARKERS, 3, generator=torch.Generator().manual_seed(0)) * 0.3
    return torch.stack([cloud + f * moved for f in range(frames)]).reshape(1, frames, -1)


def ask(goal, speed, facing=(0.0, 0.0), velocity=(0.0, 0.0)):
    return asked_of(
        seed_at(velocity),
        torch.tensor([[*goal, 0.0]]),
        torch.tensor([speed]),
        torch.tensor([facing]),
    )


def test_a_body_at_its_pace_is_asked_to_keep_it():
    ways = ask((0.0, 9.0), 1.2, velocity=(0.0, 1.2)).ways[0]
    assert ways[:, 1].tolist() == pytest.approx([1.2 * s for s in SECONDS], rel=0.01)
    assert ways[:, 0].abs().max() < 1e-3


def test_a_body_at_rest_sets_off_by_degrees():
    ways = ask((0.0, 9.0), 1.2).ways[0, :, 1].tolist()
    assert 0.02 < ways[0] < 0.5 * 1.2 * SECONDS[0]
    assert ways[2] - ways[1] == pytest.approx(1.2 * (SECONDS[2] - SECONDS[1]), rel=0.15)


def test_a_body_that_has_to_turn_back_is_asked_for_what_people_can_do():
    """Its velocity should change by 2.4 m/s: people take longer for that than for one of 1.2."""
    back = ask((0.0, -9.0), 1.2, velocity=(0.0, 1.2)).ways[0, :, 1].tolist()
    slower = [1.2 * s - b for s, b in zip(SECONDS, back, strict=True)]
    at_most = [SURGE * EASE * (s - EASE * (1 - math.exp(-s / EASE))) for s in SECONDS]
    assert slower == pytest.approx(at_most, rel=0.01)
    assert slower[0] < SURGE * SECONDS[0] ** 2 / 2


@pytest.mark.parametrize("distance", [0.05, 0.3, 0.6])
def test_nobody_is_asked_past_the_goal_or_to_run_into_it(distance):
    for speed in (0.0, 2.0):
        ways = ask((0.0, distance), speed, velocity=(0.0, 1.0)).ways[0, :, 1]
        assert (ways <= distance).all()
    slow = ask((0.0, distance), 2.0, velocity=(0.0, distance / BRAKE)).ways[0, 0, 1]
    assert slow == pytest.approx(min(distance / BRAKE * SECONDS[0], distance), abs=0.01)


@pytest.mark.parametrize(
    ("distance", "speed", "ways"),
    [
        (0.2, 0.42, (0.075, 0.142, 0.189)),
        (0.4, 0.78, (0.146, 0.286, 0.391)),
        (0.64, 0.85, (0.169, 0.391, 0.579)),
        (0.87, 1.02, (0.19, 0.466, 0.75)),
    ],
)
def test_a_body_is_asked_to_slow_down_as_recorded_people_do(distance, speed, ways):
    """Medians after .2, .5 and 1 s of recorded people that are at rest 1.6 s later and `distance`
    farther (70 to 860 frames of the training data of `mocap/`, paths smoothed over .12 s).
    """
    asked = ask((0.0, distance), 1.2, velocity=(0.0, speed)).ways[0, :, 1].tolist()
    assert asked == pytest.approx(ways, rel=0.2)


def test_a_body_that_stands_is_asked_back_slowly():
    ways = ask((2.0, 0.0), 0.0).ways[0, :, 0]
    assert 0 < ways[2] < CREEP * SECONDS[2]


def test_without_a_facing_it_is_the_way_and_with_one_that():
    along = ask((-9.0, 0.0), 1.0).facings[0]
    assert along[2, 0] < -0.8 and torch.allclose(along.norm(dim=-1), torch.ones(3))
    kept = ask((-9.0, 0.0), 1.0, facing=(0.0, 1.0)).facings[0]
    assert torch.allclose(kept, torch.tensor([0.0, 1.0]).expand(3, 2), atol=2e-3)


def test_a_turn_is_asked_for_by_degrees_on_the_shorter_side():
    for degrees in (-90, 90, 170):
        angle = math.radians(degrees)
        facings = ask((0.0, 0.0), 0.0, facing=(-math.sin(angle), math.cos(angle))).facings[0]
        turned = torch.atan2(-facings[:, 0], facings[:, 1]) / angle
        assert (torch.diff(turned) > 0).all() and (turned <= 1).all() and turned[0] > 0
        assert abs(float(turned[0] * angle)) <= TURN_MOST * SECONDS[0] + 1e-5


def test_the_seed_is_where_the_hips_are_now():
    """The goal is given from the first seed frame, the ways are from the last."""
    asked = asked_of(
        seed_at((0.0, 4.0)), torch.tensor([[0.0, 0.1, 0.0]]), torch.ones(1), torch.zeros(1, 2)
    )
    assert asked.ways[0, 2, 1].abs() < 0.06  # 4 m/s · 1/40 s: the goal is there
