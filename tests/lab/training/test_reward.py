"""Each reward against its equation, on outcomes made by hand."""

import math
from dataclasses import replace

import pytest
import torch

from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.motion.obstacles import no_obstacles
from wayfarer.motion.quality import Candidate, Sites
from wayfarer.spec import FPS
from wayfarer_lab.training import reward
from wayfarer_lab.training.pose_networks import LATENT
from wayfarer_lab.training.reward import PAPER_REWARD, REWARD, REWARD_SCALES, REWARDS

FRAMES = 9


@pytest.fixture(scope="module")
def standing():
    """A T-pose facing +Y that stands for nine frames, its goal 10 m ahead."""
    body = load_body("anny52", "male")
    rest = torch.tensor(body.rest_joints([0.0] * 10)[:1], dtype=torch.float32)
    markers, _ = marker_body(body)(rest, torch.eye(3).expand(1, 22, 3, 3), torch.zeros(1, 10))
    floor = torch.tensor([0.0, 0.0, float(markers[:, body.sole_markers, 2].min())])
    candidate = Candidate(
        markers=(markers - floor)[:, None].expand(1, FRAMES, -1, -1),
        velocity=torch.zeros(1, len(body.marker_names), 3),
        goal=torch.tensor([[0.0, 10.0, 0.0]]),
        obstacles=no_obstacles(1),
        target_speed=torch.zeros(1),
        wished_facing=torch.zeros(1, 2),
        sites=Sites.from_names(body.marker_names),
    )
    hips = (rest - floor)[:, None].expand(1, FRAMES, 3)
    return reward.PrimitiveOutcome(candidate, hips, torch.zeros(1, FRAMES - 1, LATENT))


def gliding(o, velocity):
    """The same body sliding along."""
    way = torch.arange(FRAMES)[None, :, None] / FPS * torch.tensor(velocity)
    body = replace(o.body, markers=o.body.markers + way[:, :, None])
    return replace(o, body=body, hips=o.hips + way)


@pytest.mark.parametrize(
    ("velocity", "expected"),
    [([0.0, 1.0, 0.0], 1.0), ([0.0, -1.0, 0.0], 0.0), ([1.0, 0.0, 0.0], 0.5), ([0.0] * 3, 0.5)],
)
def test_path_is_eq_5(standing, velocity, expected):
    assert reward.path(gliding(standing, velocity)).item() == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    ("goal", "expected"), [((0.0, 9.0), 1.0), ((9.0, 0.0), 0.5), ((0.0, -9.0), 0.0)]
)
def test_orientation_is_eq_6(standing, goal, expected):
    asked = replace(standing, body=replace(standing.body, goal=torch.tensor([[*goal, 0.0]])))
    assert reward.orientation(asked).item() == pytest.approx(expected, abs=0.02)


def test_orientation_follows_a_wished_facing(standing):
    body = replace(standing.body, wished_facing=torch.tensor([[1.0, 0.0]]))
    assert reward.orientation(replace(standing, body=body)).item() == pytest.approx(0.5, abs=0.02)


def test_contact_is_eq_7_with_the_paper_s_square(standing):
    assert reward.contact(standing).item() == pytest.approx(1, abs=1e-6)
    slid = reward.contact(gliding(standing, [0.0, 0.5, 0.0]))
    assert slid.item() == pytest.approx(math.exp(-(0.5**2)), abs=1e-3)
    rising = reward.contact(gliding(standing, [0.0, 0.0, 0.5]))
    rise = 0.5 * (FRAMES - 1) / FPS
    assert rising.item() == pytest.approx(math.exp(-rise - 0.5**2), abs=1e-3)


def test_one_marker_at_rest_is_contact(standing):
    moved = gliding(standing, [0.0, 1.0, 0.0])
    markers = moved.body.markers.clone()
    markers[:, :, 5] = standing.body.markers[:, :, 5]
    planted = replace(moved, body=replace(moved.body, markers=markers))
    assert reward.contact(planted).item() == pytest.approx(1, abs=1e-6)


def test_pose_prior_is_eq_8_per_latent(standing):
    assert reward.pose_prior(standing).item() == 1
    off = replace(standing, pose=torch.full((1, FRAMES - 1, LATENT), 0.8))
    assert reward.pose_prior(off).item() == pytest.approx(math.exp(-0.64))


@pytest.mark.parametrize(
    ("closest", "expected"), [(0.5, 1.0), (0.75, 1.0), (5.0, 0.75), (20.0, 0.0), (31.0, 0.0)]
)
def test_goal_is_eq_9(closest, expected):
    got = reward.goal(torch.tensor([closest]), area=20.0, reached=0.75)
    assert got.item() == pytest.approx(expected)


def test_every_reward_is_from_0_to_1_whatever_happens(standing):
    torch.manual_seed(0)
    for scale in (0.0, 0.1, 5.0):
        body = replace(
            standing.body,
            markers=standing.body.markers + scale * torch.randn_like(standing.body.markers),
        )
        o = reward.PrimitiveOutcome(
            body, standing.hips + scale, scale * torch.randn_like(standing.pose)
        )
        values = reward.evaluate(o)
        assert values.shape == (1, len(REWARDS) - 1)
        assert ((values >= 0) & (values <= 1)).all()


def test_a_reward_of_a_quality_term_falls_to_a_third_at_its_scale(standing):
    glide = gliding(standing, [0.0, REWARD_SCALES["speed"], 0.0])  # asked to stand
    got = reward.evaluate(glide)[0, REWARDS.index("speed")]
    assert got.item() == pytest.approx(math.exp(-1), abs=1e-3)


def test_weight_tables_name_only_rewards():
    assert set(PAPER_REWARD) <= set(REWARD) <= set(REWARDS)
