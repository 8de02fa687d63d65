"""A short analytic training on untrained networks: it resumes, and touches only the policy."""

import pytest
import torch

from tests.lab.training.fakes import gliding_frames
from wayfarer.body.library import load_body
from wayfarer.body.skeleton import joint_names
from wayfarer.marker_bodies import marker_body
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS
from wayfarer_lab.training.analytic import (
    AnalyticConfig,
    AnalyticTrainer,
    Posture,
    off_body,
    train_analytic,
)
from wayfarer_lab.training.crowd import Crowd
from wayfarer_lab.training.rotation import matrix_from_rotvec


@pytest.fixture
def config(tmp_path):
    """Untrained networks, which hardly move a body."""
    torch.manual_seed(0)
    networks = {"predictor": MarkerPredictor(2)}
    for gender in GENDERS:
        networks[gender] = BodyRegressor(marker_body(load_body("anny52", gender)))
    for name, network in networks.items():
        (tmp_path / name).mkdir()
        torch.save({"model": network.state_dict()}, tmp_path / name / "last.pt")
    return AnalyticConfig(
        predictor=str(tmp_path / "predictor"),
        regressors={g: str(tmp_path / g) for g in GENDERS},
        steps=6, agents=8, horizon=2, mix={"walk": 1.0},
    )  # fmt: skip


def test_an_update_changes_the_policy_and_no_other_network(config):
    trainer = AnalyticTrainer(config, gliding_frames(), gliding_frames(seed=1))
    trainer.run = type("Run", (), {"step": 300})()
    step = trainer.steps["male"]
    others = [*step.predictor.parameters(), *step.regressor.parameters()]
    before = [p.clone() for p in others]
    output = trainer.policy.output.weight.clone()
    losses = trainer.update()
    assert set(losses) == {"cost", "kl", "fallen"}
    assert all(torch.equal(a, b) for a, b in zip(before, others, strict=True))
    assert not torch.equal(output, trainer.policy.output.weight)


def test_slopes_reach_the_policy_through_later_steps(config):
    """The cost of the second step depends on the latent of the first."""
    trainer = AnalyticTrainer(config, gliding_frames(), gliding_frames(seed=1))
    crowd, tasks = trainer.crowds["male"], trainer.tasks["male"]
    crowd, _, _, first = trainer.advance("male", crowd, tasks)
    _, cost, _, _ = trainer.advance("male", crowd, tasks)
    (slope,) = torch.autograd.grad(cost.sum(), first.mean)
    assert slope.abs().sum() > 0


def test_a_run_ends_and_resumes_to_nothing(config, tmp_path):
    data = gliding_frames(), gliding_frames(seed=1)
    assert train_analytic(config, *data, tmp_path / "policy")
    before = torch.load(tmp_path / "policy" / "last.pt", weights_only=True)["model"]
    assert train_analytic(config, *data, tmp_path / "policy")
    after = torch.load(tmp_path / "policy" / "last.pt", weights_only=True)["model"]
    assert all(torch.equal(before[k], after[k]) for k in before)
    assert "val/walk_speed" in (tmp_path / "policy" / "log.txt").read_text()


def test_crouching_and_knees_beyond_their_limits_are_priced():
    model = load_body("anny52", "male")
    body, posture = marker_body(model), Posture.from_names(model.marker_names)
    betas = torch.zeros(1, 10)

    def strain(knee_deg: float, hips: float = 0.0) -> float:
        turns = torch.zeros(1, 22, 3)
        for side in ("left", "right"):
            turns[0, joint_names().index(f"{side}_knee"), 0] = -torch.deg2rad(
                torch.tensor(knee_deg)
            )
        place = torch.tensor([[0.0, 0.0, hips]])
        markers, _ = body(place, matrix_from_rotvec(turns), betas)
        resting = body.resting(betas)
        height = -resting[:, 2].amin(-1)  # hips stand at the origin of the T-pose
        return float(posture.strain(markers + height, resting))

    assert strain(0) == strain(60) == 0
    assert 0.5 < strain(145) < 3
    assert strain(-20) > 0.5
    assert strain(30, hips=-0.2) > 1


def test_markers_that_are_no_bodys_are_told_by_how_far_they_miss_it():
    body = marker_body(load_body("anny52", "male"))
    rotations = torch.tensor([0.0, 0, 0, 1]).expand(1, 2, 22, 4)
    place, betas = torch.zeros(1, 2, 3), torch.zeros(1, 10)
    own, _ = body.skin(body.shaped(betas), place, matrix_from_rotvec(torch.zeros(1, 2, 22, 3)))
    miss = torch.tensor([0.0, 0.0, 0.05], requires_grad=True)
    blended = (own + (own + miss)) / 2  # as a step hands it on
    off = off_body(Crowd(blended, place, rotations, betas), body)
    assert off.item() == pytest.approx(0.05, abs=1e-4)
    off.sum().backward()
    assert miss.grad is not None and miss.grad[2] > 0
