"""Each term measures what its name says, on bodies moved by hand."""

import math

import pytest
import torch

from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import InvalidArgument
from wayfarer.motion import quality
from wayfarer.motion.obstacles import no_obstacles
from wayfarer.motion.quality import Candidate, Sites
from wayfarer.spec import FPS
from wayfarer.terms import STAND, TERMS, TURN, WALK, weights

FRAMES = 9


@pytest.fixture(scope="module")
def body():
    return load_body("anny52", "male")


@pytest.fixture(scope="module")
def standing(body):
    """Markers of the T-pose with soles on the floor, one agent, the same in every frame."""
    rest = torch.tensor(body.rest_joints([0.0] * 10)[:1], dtype=torch.float32)
    eye = torch.eye(3).expand(1, 22, 3, 3)
    markers, _ = marker_body(body)(rest, eye, torch.zeros(1, 10))
    soles = markers[:, body.sole_markers, 2].min()
    return (markers - torch.tensor([0.0, 0.0, float(soles)]))[:, None].expand(1, FRAMES, -1, -1)


def candidate(
    body,
    markers,
    goal=(0.0, 10.0, 0.0),
    speed=0.0,
    facing=(0.0, 0.0),
    before=None,
    obstacles=None,
):
    """`before` is the velocity of the seed in m/s; default: at rest."""
    sites = Sites.from_names(body.marker_names)
    velocity = torch.tensor(before or [0.0, 0.0, 0.0]).expand(1, 67, 3) / FPS
    asked = torch.tensor([goal]), torch.tensor([speed]), torch.tensor([facing])
    near = no_obstacles(1) if obstacles is None else torch.tensor([obstacles])
    return Candidate(markers, velocity, *asked, near, sites)


def moving(markers, velocity):
    time = torch.arange(FRAMES)[None, :, None, None] / FPS
    return markers + time * torch.tensor(velocity)


def test_standing_still_costs_nothing_but_the_distance(body, standing):
    values = dict(zip(TERMS, quality.evaluate(candidate(body, standing))[0].tolist(), strict=True))
    assert values["goal_distance"] == pytest.approx(10, abs=0.15)
    for name in ("speed", "sinking", "skating", "sliding", "stillness", "feet_apart", "seam"):
        assert values[name] == pytest.approx(0, abs=1e-3), name
    assert values["upright"] < 0.02
    assert values["floating"] < 1e-3


@pytest.mark.parametrize("degrees", [5, 12, 25])
def test_leaning_far_costs_far_more_than_leaning(body, standing, degrees):
    angle = math.radians(degrees)
    cos, sin = math.cos(angle), math.sin(angle)
    forward = torch.tensor([[1.0, 0, 0], [0, cos, sin], [0, -sin, cos]])
    at_rest = candidate(body, standing).tilt().item()
    leaning = candidate(body, standing @ forward.T)
    assert at_rest < 0.02
    assert leaning.tilt().item() == pytest.approx(1 - math.cos(angle), abs=0.05)
    beyond = max(leaning.tilt().item() - quality.LEANING, 0)
    assert quality.upright(leaning).item() == pytest.approx(leaning.tilt().item() + 9 * beyond)


def test_a_glide_is_skating_at_its_speed(body, standing):
    gliding = candidate(body, moving(standing, [0.0, 1.3, 0.0]), speed=1.0)
    assert quality.skating(gliding).item() == pytest.approx(1.3, abs=1e-3)
    assert quality.stillness(gliding).item() == pytest.approx(1.3, abs=1e-3)
    assert quality.speed(gliding).item() == pytest.approx(0.3, abs=1e-3)


def test_a_step_on_one_planted_foot_is_no_skating_but_the_dragged_one_slides(body, standing):
    moved = moving(standing, [0.0, 1.3, 0.0])
    planted = candidate(body, moved).sites.left_sole
    moved[:, :, planted] = standing[:, :, planted]
    assert quality.skating(candidate(body, moved)).item() == pytest.approx(0, abs=1e-3)
    assert quality.sliding(candidate(body, moved)).item() == pytest.approx(0.65, abs=0.02)
    dragged = candidate(body, moved).sites.right_sole
    moved[:, :, dragged, 2] += quality.FOOT_HEIGHT
    assert quality.sliding(candidate(body, moved)).item() == pytest.approx(0, abs=1e-3)


def test_a_seam_is_the_change_of_velocity(body, standing):
    going_on = moving(standing, [0.0, 1.3, 0.0])
    assert quality.seam(candidate(body, going_on, before=[0.0, 1.3, 0.0])).item() < 1e-3
    assert quality.seam(candidate(body, going_on)).item() == pytest.approx(1.3, abs=1e-3)


@pytest.mark.parametrize(("lift", "floating", "sinking"), [(0.1, 0.1, 0.0), (-0.04, 0.0, 0.04)])
def test_height_errors(body, standing, lift, floating, sinking):
    c = candidate(body, standing + torch.tensor([0.0, 0.0, lift]))
    assert quality.floating(c).item() == pytest.approx(floating, abs=2e-3)
    assert quality.sinking(c).item() == pytest.approx(sinking, abs=2e-3)


@pytest.mark.parametrize(
    ("goal", "expected"), [((0.0, 9.0, 0.0), 0.0), ((9.0, 0.0, 0.0), 1.0), ((0.0, -9.0, 0.0), 2.0)]
)
def test_facing(body, standing, goal, expected):
    assert quality.facing(candidate(body, standing, goal)).item() == pytest.approx(
        expected, abs=0.02
    )


def test_a_wished_facing_counts_more_than_the_way(body, standing):
    aside = candidate(body, standing, (0.0, 9.0, 0.0), facing=(1.0, 0.0))
    assert quality.facing(aside).item() == pytest.approx(1.0, abs=0.02)
    ahead = candidate(body, standing, (0.0, -9.0, 0.0), facing=(0.0, 1.0))
    assert quality.facing(ahead).item() == pytest.approx(0.0, abs=0.02)


def test_a_goal_underfoot_has_no_direction(body, standing):
    beside, behind = ((0.01, 0.0, 0.0), (0.0, -0.01, 0.0))
    costs = [quality.facing(candidate(body, standing, g)).item() for g in (beside, behind)]
    assert abs(costs[0] - costs[1]) < 0.1


def test_contacts_tell_a_planted_from_a_lifted_and_from_a_sliding_foot(body, standing):
    sites = Sites.from_names(body.marker_names)
    feet = torch.stack(
        [standing[:, :, sites.left_sole], standing[:, :, sites.right_sole]], 2
    ).clone()
    feet[:, :, 0, :, 2] += 0.1
    assert (quality.foot_contacts(feet) == torch.tensor([0.0, 1.0])).all()
    feet[:, :, 0, :, 2] -= 0.1
    slide = torch.arange(FRAMES)[None, :, None] / FPS * 0.6
    feet[:, :, 1, :, 1] += slide
    assert (quality.foot_contacts(feet) == torch.tensor([1.0, 0.0])).all()


def test_weight_tables_name_only_terms():
    assert len(weights(WALK)) == len(weights(STAND)) == len(weights(TURN)) == len(TERMS)
    with pytest.raises(KeyError, match="allowed"):
        weights({"goodness": 1.0})


def test_a_body_without_the_markers_is_refused():
    with pytest.raises(InvalidArgument, match="lacks markers"):
        Sites.from_names(["C7", "CLAV"])
