"""A short analytic training on untrained networks: it resumes, and touches only the policy."""

import pytest
import torch

from tests.lab.training.fakes import gliding_frames
from wayfarer.body.library import load_body
from wayfarer.marker_bodies import marker_body
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS
from wayfarer_lab.training.analytic import AnalyticConfig, AnalyticTrainer, train_analytic


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
