"""Algebra of the whole step on the shipped body with untrained networks."""

import pytest
import torch

from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.motion.policy import GoalPolicy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.primitive import PrimitiveStep, _interpolation, _joining, _knots
from wayfarer.motion.quality import Sites
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.terms import TERMS
from wayfarer_lab.training.graphs import body_inputs, step_inputs
from wayfarer_lab.training.rotation import (
    matrix_from_quaternion,
    matrix_from_rotvec,
    quaternion_from_matrix,
)

AGENTS, CANDIDATES = 4, 3


@pytest.fixture(scope="module")
def step():
    torch.manual_seed(0)
    body = load_body("anny52", "female")
    sites = Sites.from_names(body.marker_names)
    skin = marker_body(body)
    policy = GoalPolicy()
    torch.nn.init.normal_(policy.output.weight, std=0.05)  # it begins as the prior
    return PrimitiveStep(MarkerPredictor(2), BodyRegressor(skin), skin, sites, policy).eval()


@pytest.fixture
def inputs(step):
    generator = torch.Generator().manual_seed(2)
    given = step_inputs(AGENTS, CANDIDATES, generator) | body_inputs(step, AGENTS, generator)
    return given | {"goal": torch.tensor([1.0, 5.0, 0.0]).expand(AGENTS, 3)}


def run(step, inputs):
    with torch.no_grad():
        return step(**inputs)


def test_shapes(step, inputs):
    out = run(step, inputs)
    assert out.translation.shape == (AGENTS, 8, 3)
    assert out.rotations.shape == (AGENTS, 8, 22, 4)
    assert out.contacts.shape == (AGENTS, 8, 2)
    assert out.next_seed_markers.shape == (AGENTS, 2, 67, 3)
    assert out.terms.shape == (AGENTS, len(TERMS))


def test_turning_and_moving_the_world_turns_and_moves_the_result(step, inputs):
    turn = matrix_from_rotvec(torch.tensor([0.0, 0.0, 2.1]))
    shift = torch.tensor([4.0, -3.0, 0.0])

    def move(points):
        return points @ turn.T + shift

    root = matrix_from_quaternion(inputs["seed_rotations"][:, :, :1])
    turned = torch.cat([quaternion_from_matrix(turn @ root), inputs["seed_rotations"][:, :, 1:]], 2)
    moved = inputs | {
        "seed_markers": move(inputs["seed_markers"]),
        "seed_translation": move(inputs["seed_translation"]),
        "seed_rotations": turned,
        "goal": move(inputs["goal"]),
        "facing": inputs["facing"] @ turn[:2, :2].T,
        "obstacles": torch.cat(
            [
                inputs["obstacles"][..., 0:2] @ turn[:2, :2].T + shift[:2],
                inputs["obstacles"][..., 2:4] @ turn[:2, :2].T + shift[:2],
                inputs["obstacles"][..., 4:6] @ turn[:2, :2].T,
                inputs["obstacles"][..., 6:],
            ],
            -1,
        ),
    }
    here, there = run(step, inputs), run(step, moved)
    assert torch.equal(here.choice, there.choice)
    assert torch.allclose(move(here.translation), there.translation, atol=1e-4)
    assert torch.allclose(move(here.next_seed_markers), there.next_seed_markers, atol=1e-4)
    a = turn @ matrix_from_quaternion(here.rotations[:, :, 0])
    assert torch.allclose(a, matrix_from_quaternion(there.rotations[:, :, 0]), atol=1e-4)
    assert torch.allclose(here.terms, there.terms, atol=1e-4)
    assert (here.terms[:, TERMS.index("clearance")] > 0.01).any()


def test_a_rows_result_does_not_depend_on_its_batch(step, inputs):
    together = run(step, inputs)
    alone = run(step, {name: value[2:3] for name, value in inputs.items()})
    for whole, single in zip(together, alone, strict=True):
        assert torch.allclose(whole[2:3].double(), single.double(), atol=1e-5)


def test_the_cheapest_candidate_is_chosen(step, inputs):
    out = run(step, inputs)
    for k in range(CANDIDATES):
        one = run(step, inputs | {"noise": inputs["noise"][:, k : k + 1]})
        cost = (one.terms * inputs["term_weights"]).sum(-1)
        best = (out.terms * inputs["term_weights"]).sum(-1)
        assert (best <= cost + 1e-5).all()


def test_the_policy_moves_the_latents_as_far_as_it_is_asked_to(step, inputs):
    def goal_distances(share):
        return run(step, inputs | {"policy": torch.full((AGENTS,), share)}).terms

    prior = PrimitiveStep(step.predictor, step.regressor, step.body, step.sites).eval()
    assert torch.allclose(goal_distances(0.0), run(prior, inputs).terms, atol=1e-5)
    assert not torch.allclose(goal_distances(1.0), goal_distances(0.0), atol=1e-4)


def test_given_latents_are_used_as_they_are(step, inputs):
    """The noise is the latent at a share of 0: so PPO steps the world."""
    one = inputs | {"noise": inputs["noise"][:, :1], "policy": torch.zeros(AGENTS)}
    moved = one | {"noise": one["noise"] + 1.0}
    assert not torch.allclose(run(step, one).terms, run(step, moved).terms, atol=1e-4)


def test_a_one_frame_seed_brings_nine_frames(step, inputs):
    first = {
        name: inputs[name][:, -1:]
        for name in ("seed_markers", "seed_translation", "seed_rotations")
    }
    one = PrimitiveStep(MarkerPredictor(1), step.regressor, step.body, step.sites, step.policy)
    out = run(one.eval(), inputs | first)
    assert out.translation.shape == (AGENTS, 9, 3)
    assert out.next_seed_markers.shape == (AGENTS, 1, 67, 3)


def test_poses_leave_the_seed_without_a_jump(step, inputs):
    """The untrained regressor is far off, yet the first frame stays near the last seed frame."""
    out = run(step, inputs)
    known = matrix_from_quaternion(inputs["seed_rotations"][:, -1])
    first = matrix_from_quaternion(out.rotations[:, 0])
    last = matrix_from_quaternion(out.rotations[:, -1])
    assert (first - known).norm(dim=(-1, -2)).mean() < 0.5 * (last - known).norm(
        dim=(-1, -2)
    ).mean()


def test_inputs_are_left_as_they_were(step, inputs):
    before = {name: value.clone() for name, value in inputs.items()}
    run(step, inputs)
    assert all(torch.equal(before[n], inputs[n]) for n in inputs)


def test_pelvis_origin_measures_height_from_the_floor_all_the_same(step, inputs):
    pelvis = PrimitiveStep(
        step.predictor, step.regressor, step.body, step.sites, floor_origin=False
    )
    inputs["noise"] = inputs["noise"][:, :1]  # so that both have the same candidate
    lifted = inputs | {
        "seed_markers": inputs["seed_markers"] + torch.tensor([0, 0, 0.5]),
        "seed_translation": inputs["seed_translation"] + torch.tensor([0, 0, 0.5]),
    }
    above, below = TERMS.index("floating"), TERMS.index("sinking")
    low, high = run(pelvis.eval(), inputs).terms, run(pelvis.eval(), lifted).terms
    rise = (high - low)[:, above] - (high - low)[:, below]
    assert torch.allclose(rise, torch.tensor(0.5), atol=1e-3)


def test_the_floor_draws_bodies_back(step):
    """Half of a height error is gone after each primitive, without a jump."""
    soles = torch.zeros(1, 8, 8, 3)
    soles[..., 2] = 0.1
    lift = step._ground(soles)[0]
    assert lift[-1] == pytest.approx(-0.05)
    assert (lift.diff() < 0).all() and lift[0].abs() < 0.01
    assert (step._ground(-soles) > 0).all()


@pytest.mark.parametrize(("count", "every", "knots"), [
    (8, 1, [0, 1, 2, 3, 4, 5, 6, 7, 8]), (8, 2, [0, 2, 4, 6, 8]), (9, 2, [0, 2, 4, 6, 8, 9]),
])  # fmt: skip
def test_the_first_and_the_last_frame_are_always_regressed(count, every, knots):
    assert _knots(count, every) == knots


@pytest.mark.parametrize("knots", [_knots(8, 1), _knots(8, 2), _knots(9, 2)])
def test_cubic_motion_is_interpolated_exactly(knots):
    t = torch.arange(knots[-1] + 1, dtype=torch.float64) / knots[-1]
    motion = torch.stack([t**3 - t, 2 * t**2, 1 - t], 1)
    assert torch.allclose(_interpolation(knots) @ motion[knots], motion)


@pytest.mark.parametrize("every", [1, 2])
def test_new_frames_go_on_from_the_last_that_was_shown(every):
    """Frames found at a constant offset join the shown ones at the seam and end free."""
    knots = _knots(8, every)
    shown = torch.tensor([[0.0], [1.0]], dtype=torch.float64)  # one unit a frame
    found = torch.tensor(knots, dtype=torch.float64)[:, None] + 1 + 5
    joined = (_joining(2, knots, torch.float64) @ torch.cat([shown, found]))[:, 0]
    assert joined[0] - 1 == pytest.approx(1.0, abs=0.4)
    assert joined[-1] == pytest.approx(8 + 1 + 5)
    assert (joined.diff() > 0).all()


def test_every_second_frame_suffices(step, inputs):
    """Between regressed frames the motion is unchanged, except for its finest detail."""
    sparse = PrimitiveStep(
        step.predictor, step.regressor, step.body, step.sites, step.policy, every=2
    )
    whole, half = run(step, inputs), run(sparse.eval(), inputs)
    assert torch.equal(whole.choice, half.choice)
    assert (whole.translation - half.translation).abs().max() < 0.01
