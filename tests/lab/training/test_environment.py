"""The simulated world on real bodies and untrained networks."""

import math

import pytest
import torch

from tests.lab.training.walkers import environment
from wayfarer.motion.obstacles import no_obstacles
from wayfarer.motion.quality import Candidate
from wayfarer.spec import LATENT
from wayfarer_lab.training.environment import Task, feedback_of, take
from wayfarer_lab.training.reward import REWARDS, PrimitiveOutcome
from wayfarer_lab.training.rotation import (
    matrix_from_quaternion,
    matrix_from_rotvec,
    quaternion_from_matrix,
)
from wayfarer_lab.training.starts import about_z


@pytest.fixture(scope="module")
def world():
    return environment()


def begun(world, starts=4, clones=2, seed=0):
    torch.manual_seed(seed)
    agents = world.reset(starts, clones)
    return agents, torch.randn(starts * clones, LATENT)


@pytest.mark.parametrize("frames", [1, 2])
def test_agents_start_on_the_floor_in_the_middle_clones_alike(frames):
    agents, _ = begun(environment(frames), starts=6, clones=3)
    assert agents.markers.shape == (18, frames, 67, 3)
    lowest = agents.markers[..., 2].amin((1, 2))
    assert torch.allclose(lowest, torch.zeros(18), atol=1e-5)
    assert torch.allclose(agents.translation[:, 0, :2], torch.zeros(18, 2), atol=1e-5)
    assert agents.goal[:, :2].abs().max() <= 10 and (agents.goal[:, 2] == 0).all()
    for field in agents:
        assert torch.equal(field[0], field[2])  # clones of one start
    assert not torch.equal(agents.goal[0], agents.goal[3])
    assert agents.target_speed.min() >= 0.6 and agents.target_speed.max() <= 1.6


def test_headings_and_genders_differ(world):
    agents, _ = begun(world, starts=24, clones=1)
    right = matrix_from_quaternion(agents.rotations[:, 0, 0])[:, :2, 0]
    assert (right.mean(0).norm()) < 0.6
    assert set(agents.gender.tolist()) == {0, 1}


def test_near_goals_lie_in_a_ring_that_is_not_reached_yet():
    task = Task(near_share=1.0, near=2.0)
    agents, _ = begun(environment(task=task), starts=50, clones=1)
    distance = agents.goal.norm(dim=-1)
    assert (distance >= task.reached - 1e-5).all() and (distance <= task.near + 1e-5).all()


def test_seeds_are_canonical_again_after_every_step(world):
    """The state of Eq. 3 is in the frame of the seed's first frame, which the test computes."""
    agents, latents = begun(world)
    for _ in range(3):
        right = matrix_from_quaternion(agents.rotations[:, 0, 0])[:, :2, 0]
        back = about_z(-torch.atan2(right[:, 1], right[:, 0])).transpose(-1, -2)
        under_hips = agents.translation[:, :1] * torch.tensor([1.0, 1.0, 0.0])
        expected = (agents.markers - under_hips[:, :, None]) @ back[:, None]
        goal = (agents.goal[:, None] - under_hips) @ back
        state = world.observe(agents)
        assert torch.allclose(state.seed, expected.flatten(2), atol=1e-4)
        assert torch.allclose(state.condition.goal, goal[:, 0], atol=1e-4)
        agents, _ = world.step(agents, latents)


def test_the_first_primitive_can_be_a_1_frame_model_s_as_in_the_paper():
    agents, latents = begun(environment(lead=True))
    assert agents.markers.shape[1] == 1
    world = environment(lead=True)
    after, _ = world.step(agents, latents)
    assert after.markers.shape[1] == after.translation.shape[1] == 2
    body = world.steps[0].body  # the frame before the last is the body's own
    first = int(torch.nonzero(after.gender == 0)[0])
    local = matrix_from_quaternion(after.rotations[first : first + 1])
    shape = body.shaped(after.betas[first : first + 1])
    markers, _ = body.skin(shape, after.translation[first : first + 1], local)
    assert torch.allclose(markers[0, 0], after.markers[first, 0], atol=1e-4)
    again, _ = world.step(after, latents)
    assert again.markers.shape == after.markers.shape


def test_state_and_reward_do_not_depend_on_place_and_heading(world):
    """Therefore no reward compares places of different frames of reference."""
    agents, latents = begun(world)
    turn, shift = about_z(torch.tensor([2.0]))[0], torch.tensor([30.0, -7.0, 0.0])

    def moved(points):
        return points @ turn.T + shift

    root = quaternion_from_matrix(turn @ matrix_from_quaternion(agents.rotations[:, :, :1]))
    there = agents._replace(
        markers=moved(agents.markers),
        translation=moved(agents.translation),
        rotations=torch.cat([root, agents.rotations[:, :, 1:]], 2),
        goal=moved(agents.goal),
    )
    seed, seed_there = world.observe(agents).seed, world.observe(there).seed
    assert torch.allclose(seed, seed_there, atol=1e-4)
    for _ in range(2):
        agents, here = world.step(agents, latents)
        there, yonder = world.step(there, latents)
        assert torch.allclose(here.rewards, yonder.rewards, atol=2e-3)
        assert torch.allclose(here.distance, yonder.distance, atol=1e-3)
        assert torch.allclose(moved(here.hips), yonder.hips, atol=1e-3)


def test_a_row_does_not_depend_on_its_batch_or_its_neighbours_gender(world):
    agents, latents = begun(world)
    both, feedback = world.step(agents, latents)
    rows = torch.tensor([5, 2])
    alone, some = world.step(take(agents, rows), latents[rows])
    assert torch.allclose(both.markers[rows], alone.markers, atol=1e-4)
    assert torch.allclose(feedback.rewards[rows], some.rewards, atol=1e-4)


def test_rewards_are_named_and_bounded(world):
    agents, latents = begun(world)
    _, feedback = world.step(agents, latents)
    assert feedback.rewards.shape == (8, len(REWARDS) - 1)
    assert (feedback.rewards >= 0).all() and (feedback.rewards <= 1).all()
    assert not feedback.broken.any()


def test_bodies_that_break_are_found_and_harm_nobody_else(world):
    agents, latents = begun(world)
    _, before = world.step(agents, latents)
    sunk = agents.translation.clone()
    sunk[2, :, 2] -= 3
    latents[0] = torch.nan
    _, after = world.step(agents._replace(translation=sunk), latents)
    assert after.broken.tolist() == [True, False, True] + [False] * 5
    assert (after.rewards[[0, 2]] == 0).all()
    rest = [1, 3, 4, 5, 6, 7]
    assert torch.allclose(after.rewards[rest], before.rewards[rest], atol=1e-5)


@pytest.mark.parametrize(("tilt", "fallen"), [(0.0, False), (40.0, False), (80.0, True)])
def test_who_lies_has_fallen(world, tilt, fallen):
    """A T-pose that leans forward in the last frame, hips at 1 m."""
    step = world.steps[0]
    lean = matrix_from_rotvec(torch.tensor([-math.radians(tilt), 0.0, 0.0]))
    pose = torch.cat([lean[None], torch.eye(3).expand(21, 3, 3)]).expand(1, 9, 22, 3, 3)
    hips = torch.tensor([0.0, 0.0, 1.0]).expand(1, 9, 3)
    markers, _ = step.body.skin(step.body.shaped(torch.zeros(1, 10)), hips, pose)
    goal, zero = torch.tensor([[0.0, 5.0, 0.0]]), torch.zeros(1, 67, 3)
    body = Candidate(
        markers, zero, goal, torch.ones(1), torch.zeros(1, 2), no_obstacles(1), step.sites
    )
    feedback = feedback_of(PrimitiveOutcome(body, hips, torch.zeros(1, 8, 32)))
    assert feedback.broken.item() is fallen
    assert feedback.distance.item() == pytest.approx(5)
