"""The g-CVAE: its network, training and export on synthetic motion."""

import pytest
import torch

from tests.lab.training.fakes import gliding_frames
from wayfarer.body.library import load_body
from wayfarer.engines.onnx_engine import INPUTS
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.motion.policy import state
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.regressor import BodyRegressor
from wayfarer_lab.training.cli import read_config
from wayfarer_lab.training.goal_cvae import (
    GoalCvae,
    GoalCvaeConfig,
    GoalCvaeTrainer,
    load_goal_cvae_graphs,
    train_goal_cvae,
)

ROWS, CANDIDATES = 3, 2
SMALL = GoalCvaeConfig(steps=30, batch=64, rate=2e-3, goal_seconds=1.0)


def save_run(folder, model):
    """The part of a run folder that export needs."""
    folder.mkdir(parents=True)
    torch.save({"model": model.state_dict()}, folder / "last.pt")
    (folder / "config.json").write_text('{"floor_origin": true}')
    return folder


def test_goals_are_where_the_same_clip_goes():
    frames = gliding_frames(clips=2)
    trainer = GoalCvaeTrainer(SMALL, frames, frames)
    at = torch.arange(0, 80).repeat(20)  # up to the last whole primitive of the first clip
    seed = torch.zeros(len(at), 2, 201)  # markers at the origin: directions are those of the goal
    ways = trainer.condition(frames, at, seed)[:, 0, 201:204]
    assert torch.allclose(ways[:, [0, 2]], torch.zeros(()), atol=1e-3), "this clip goes along Y"
    assert (ways[:, 1] > 0.9).all(), "and goals lie ahead, none in the other clip"


def test_a_goal_is_no_farther_than_asked():
    frames = gliding_frames(clips=2)
    trainer = GoalCvaeTrainer(SMALL.model_copy(update={"goal_seconds": 0.5}), frames, frames)
    at = torch.zeros(500, dtype=torch.long)
    step = frames.hips[1, 1] - frames.hips[0, 1]
    markers = torch.tensor([1.0, 0.0, 0.0]).repeat(500, 2, 67)  # one metre beside the way
    ways = trainer.condition(frames, at, markers)[:, 0, 201:204]
    ahead = -ways[:, 1] / ways[:, 0] / step  # frames, from the angle that the goal is seen at
    assert ahead.min() == pytest.approx(9.0, abs=0.1) and ahead.max() == pytest.approx(
        19.0, abs=0.1
    )


def test_a_short_training_goes_on_from_a_predictor(tmp_path):
    torch.manual_seed(0)
    known = MarkerPredictor(2)
    config = SMALL.model_copy(update={"start_from": str(save_run(tmp_path / "p", known))})
    frames = gliding_frames()
    fresh = GoalCvaeTrainer(config, frames, frames)
    assert torch.equal(fresh.model.from_latent.weight, known.from_latent.weight)
    before = fresh.validate()["val/posterior_cm"]
    assert train_goal_cvae(config, frames, frames, tmp_path / "run")
    last = (tmp_path / "run" / "log.txt").read_text().splitlines()[-1]
    assert float(last.split("val/posterior_cm")[1].split()[0]) < before


def test_the_shipped_config_starts_from_the_shipped_predictor():
    config = read_config(GoalCvaeConfig, "goal_cvae")
    assert config.start_from == "runs/predictor_2f_rollout" and config.rollout == 8


def test_the_graphs_of_the_baseline_look_at_the_goal(tmp_path):
    torch.manual_seed(0)
    run = save_run(tmp_path / "goal_cvae", GoalCvae(2))
    regressor = BodyRegressor(marker_body(load_body("anny52", "female")))
    graphs = load_goal_cvae_graphs(run, {"female": save_run(tmp_path / "female", regressor)})
    assert set(graphs) == {"step_female.onnx", "regressor_female.onnx"}
    step, inputs = graphs["step_female.onnx"].module, graphs["step_female.onnx"].inputs
    assert set(inputs) == set(INPUTS), "it is stepped like any other model"
    with torch.no_grad():
        here = step(**inputs)
        there = step(**inputs | {"goal": -inputs["goal"]})
        prior = step(**inputs | {"policy": 1 - inputs["policy"]})
    assert not torch.allclose(here.translation, there.translation, atol=1e-4)
    assert torch.equal(here.translation, prior.translation), "there is no policy to have a share"


@pytest.fixture
def seed() -> torch.Tensor:
    return torch.randn(ROWS, 2, 201, generator=torch.Generator().manual_seed(0))


@pytest.fixture
def latent() -> torch.Tensor:
    return torch.randn(ROWS, CANDIDATES, 128, generator=torch.Generator().manual_seed(1))


def goal(x: float) -> torch.Tensor:
    return torch.tensor([x, 5.0, 0.0]).expand(ROWS, 3)


def test_it_begins_as_the_predictor_it_starts_from(seed, latent):
    predictor, model = MarkerPredictor(2), GoalCvae(2)
    model.start_from(predictor)
    with torch.no_grad():
        told = state(seed, goal(1.0))
        assert torch.allclose(model.decode(told, latent), predictor.decode(seed, latent), atol=1e-6)
        future = torch.randn(ROWS, 8, 201)
        posterior, known = model.encode(told, future), predictor.encode(seed, future)
        assert torch.allclose(posterior.mean, known.mean, atol=1e-6)


def test_it_can_look_at_the_goal(seed, latent):
    model = GoalCvae(2)
    with torch.no_grad():
        left, right = (model.decode(state(seed, goal(x)), latent) for x in (-5.0, 5.0))
    assert left.shape == (ROWS, CANDIDATES, 8, 201)
    assert not torch.allclose(left, right, atol=1e-3)


def test_the_state_holds_unit_vectors_to_the_goal(seed):
    made = state(seed, goal(1.0))
    assert torch.equal(made[..., :201], seed)
    ways = made[..., 201:].unflatten(-1, (67, 3))
    assert torch.allclose(ways.norm(dim=-1), torch.ones(()), atol=1e-4)
    first = torch.tensor([1.0, 5.0, 0.0]) - seed[0, 1, :3]
    assert torch.allclose(ways[0, 1, 0], first / first.norm(), atol=1e-4)
