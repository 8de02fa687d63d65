"""A short analytic training on untrained networks: it resumes, and touches only the policy."""

import pytest
import torch
from pydantic import ValidationError

from tests.lab.training.fakes import gliding_frames, straight_walks
from wayfarer.body.library import load_body
from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer.marker_bodies import load_marker_bodies, marker_body
from wayfarer.motion.policy import GoalPolicy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS
from wayfarer_lab.training.analytic import (
    FALL,
    AnalyticConfig,
    AnalyticTrainer,
    priced,
    train_analytic,
)
from wayfarer_lab.training.run import load_weights
from wayfarer_lab.training.steady import SETTLED, LikenessConfig
from wayfarer_lab.training.walks import Walks


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


def test_the_step_that_fells_an_agent_costs_more_than_any_other():
    cost = torch.tensor([0.3, 0.3, 1e9, torch.nan], requires_grad=True)
    got = priced(cost, torch.tensor([False, True, False, True]))
    assert got[0].item() == pytest.approx(0.3, rel=1e-3)
    assert got[1] == got[3] == FALL and got[2] <= FALL
    got.sum().backward()
    assert cost.grad[0] > 0.99 and (cost.grad[1:] == 0).all()


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
    crowd, _, _, first, _ = trainer.advance("male", crowd, tasks)
    cost = trainer.advance("male", crowd, tasks).cost
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


def with_critic(config: AnalyticConfig, **others) -> AnalyticConfig:
    return config.model_copy(update={"likeness": LikenessConfig(), **others})


@pytest.fixture(scope="module")
def walks():
    torch.manual_seed(0)
    return Walks(straight_walks(), "train", load_marker_bodies("anny52"), windows=30)


def test_a_training_with_a_critic_resumes_with_it_and_another_may_start_from_it(
    config, walks, tmp_path, monkeypatch
):
    monkeypatch.setattr("wayfarer_lab.training.steady.SETTLED", 0)  # untrained, nobody walks
    data, folder = (gliding_frames(), gliding_frames(seed=1)), tmp_path / "policy"
    asked = with_critic(config)
    assert train_analytic(asked, *data, folder, walks=walks)
    before = torch.load(folder / "last.pt", weights_only=True)
    assert before["critic_optimizer"]["state"], "the critic never learnt"
    assert train_analytic(asked, *data, folder, walks=walks)
    after = torch.load(folder / "last.pt", weights_only=True)["critic"]
    assert all(torch.equal(before["critic"][k], after[k]) for k in after)

    further = asked.model_copy(update={"start_from": str(folder), "steps": 0})
    assert train_analytic(further, *data, tmp_path / "further", walks=walks)
    taken = torch.load(tmp_path / "further" / "last.pt", weights_only=True)["critic"]
    assert all(torch.equal(taken[k], after[k]) for k in after)


def test_a_checkpoint_that_lost_its_critic_is_an_error(config, walks, tmp_path):
    data, folder = (gliding_frames(), gliding_frames(seed=1)), tmp_path / "policy"
    asked = with_critic(config, steps=0)
    train_analytic(asked, *data, folder, walks=walks)
    state = torch.load(folder / "last.pt", weights_only=True)
    del state["critic"]
    torch.save(state, folder / "last.pt")
    with pytest.raises(ArtifactError, match="'critic'"):
        train_analytic(asked, *data, folder, walks=walks)


def test_a_band_of_speeds_costs_walkers_nothing(config):
    cost = []
    for band in (0.0, 10.0):
        asked = config.model_copy(update={"speed_band": band, "noise": (0.0, 0.0)})
        trainer = AnalyticTrainer(asked, gliding_frames(), gliding_frames(seed=1))
        tasks = trainer.tasks["male"]
        tasks.kind[:], tasks.speed[:] = 0, 1.2
        cost.append(trainer.advance("male", trainer.crowds["male"], tasks))
    free = 0.7 * cost[0].terms[:, 2]
    assert (free > 0).all()
    assert torch.allclose(cost[0].cost - cost[1].cost, free, atol=1e-4)


def test_impossible_settings_are_refused(config, walks):
    fields = config.model_dump()
    for wrong, told in (
        ({"horizon": 8, "likeness": {}}, "at most 7"),
        ({"noise": (1.0, 0.5)}, "not a range"),
        ({"likeness": {"wieght": 1.0}}, "wieght"),
        ({"speed_band": -0.1}, "greater than or equal to 0"),
    ):
        with pytest.raises(ValidationError, match=told):
            AnalyticConfig.model_validate(fields | wrong)
    assert SETTLED * 8 > 64  # a window never reaches back to before the walk
    with pytest.raises(InvalidArgument, match="recorded walks"):
        AnalyticTrainer(with_critic(config), gliding_frames(), gliding_frames())


def test_a_moving_average_of_the_weights_is_what_others_load(config, tmp_path):
    asked = config.model_copy(update={"average": 0.9, "steps": 2})
    train_analytic(asked, gliding_frames(), gliding_frames(seed=1), tmp_path / "policy")
    state = torch.load(tmp_path / "policy" / "last.pt", weights_only=True)
    served = load_weights(GoalPolicy(), tmp_path / "policy").output.weight
    assert torch.equal(served, state["average"]["output.weight"])
    assert not torch.equal(served, state["model"]["output.weight"])
