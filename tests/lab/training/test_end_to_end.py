"""Predictor and regressors trained together (Eq. 12)."""

import json

import pytest
import torch

from tests.lab.training.fakes import walking_frames
from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import InvalidArgument
from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS
from wayfarer_lab.evaluation.model_parts import load_parts
from wayfarer_lab.training.end_to_end import EndToEndConfig, EndToEndTrainer, train_end_to_end
from wayfarer_lab.training.run import load_weights

DATA = walking_frames()


def write_run(folder, network) -> str:
    folder.mkdir()
    torch.save({"model": network.state_dict()}, folder / "last.pt")
    (folder / "config.json").write_text('{"gender": "male"}')
    return str(folder)


@pytest.fixture
def config(tmp_path) -> EndToEndConfig:
    torch.manual_seed(0)
    return EndToEndConfig(
        learned_prior=False,
        steps=10,
        batch=32,
        rate=1e-3,
        rollout=2,
        start_from=write_run(tmp_path / "predictor", MarkerPredictor(2)),
        start_regressors={
            gender: write_run(
                tmp_path / gender, BodyRegressor(marker_body(load_body("anny52", gender)))
            )
            for gender in GENDERS
        },
    )


def test_the_loss_of_bodies_moves_every_network(config):
    trainer = EndToEndTrainer(config, DATA, DATA)
    starts = torch.tensor([3, 70])  # of both genders
    first, second = trainer.losses(DATA, starts, 2)
    (first.reconstruction + second.velocity).backward()
    for network in (trainer.model.output, trainer.model.mean, *trainer.kind.regressors):
        grown = [p.grad is not None and bool(p.grad.any()) for p in network.parameters()]
        assert sum(grown) > 0.9 * len(grown), network
    known = {id(p) for group in trainer.optimizer.param_groups for p in group["params"]}
    assert {id(p) for r in trainer.kind.regressors for p in r.parameters()} <= known


def test_what_comes_out_is_runs_that_can_be_measured(config, tmp_path):
    out = tmp_path / "out"
    before = EndToEndTrainer(config, DATA, DATA).validate()["val/posterior_cm"]
    assert train_end_to_end(config, DATA, DATA, out)
    last = (out / "log.txt").read_text().splitlines()[-1]
    assert float(last.split("val/posterior_cm")[1].split()[0]) < 0.95 * before
    made = torch.load(out / "last.pt", weights_only=True)
    parts = load_parts(DEFAULT_MODEL, out, threads=1)
    for name, network in (
        ("model", parts.predictors["ro-2f"]),
        *((f"regressor_{gender}", parts.regressors[gender]) for gender in GENDERS),
    ):
        weights = network.state_dict()
        assert all(torch.equal(weights[k], v) for k, v in made[name].items() if k in weights)
    effort = json.loads((out / "predictor_2f_rollout" / "effort.json").read_text())
    assert effort["steps"] == config.steps
    assert not (out / "regressor_male" / "effort.json").exists(), "told once"
    kept = {name: value.clone() for name, value in made["regressor_male"].items()}
    assert train_end_to_end(config, DATA, DATA, out), "resumes to nothing"
    again = torch.load(out / "regressor_male" / "last.pt", weights_only=True)["model"]
    assert all(torch.equal(again[name], value) for name, value in kept.items())
    loaded = load_weights(MarkerPredictor(2), out)
    assert torch.equal(loaded.mean.weight, made["model"]["mean.weight"])


def test_every_network_needs_a_start(config):
    for change in (
        {"start_regressors": {"male": config.start_regressors["male"]}},
        {"start_from": ""},
        {"regressors": config.start_regressors},
    ):
        with pytest.raises(InvalidArgument):
            EndToEndTrainer(config.model_copy(update=change), DATA, DATA)
