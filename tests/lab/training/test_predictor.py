import json

import pytest
import torch

from tests.lab.training.fakes import gliding_frames, walking_frames
from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import InvalidArgument
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS, MARKERS
from wayfarer_lab.training.cli import CONFIGS, read_config
from wayfarer_lab.training.predictor import (
    PredictorConfig,
    PredictorTrainer,
    sole_lift,
    train_predictor,
)
from wayfarer_lab.training.representation import Markers

SMALL = PredictorConfig(steps=60, batch=64, rate=2e-3)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "small"
    assert train_predictor(SMALL, gliding_frames(), gliding_frames(seed=1), folder)
    return folder


def test_a_short_training_learns_to_glide(trained):
    last = (trained / "log.txt").read_text().splitlines()[-1]
    fresh = PredictorTrainer(SMALL, gliding_frames(), gliding_frames(seed=1)).validate()
    error = float(last.split("val/posterior_cm")[1].split()[0])
    assert error < 0.5 * fresh["val/posterior_cm"]


def test_a_finished_run_resumes_to_nothing_and_keeps_its_weights(trained):
    before = torch.load(trained / "last.pt", weights_only=True)["model"]
    assert train_predictor(SMALL, gliding_frames(), gliding_frames(seed=1), trained)
    after = torch.load(trained / "last.pt", weights_only=True)["model"]
    assert all(torch.equal(before[k], after[k]) for k in before)


def test_the_paper_s_prior_is_n_0_i_and_stays_it(trained, tmp_path):
    data, held = gliding_frames(), gliding_frames(seed=1)
    config = SMALL.model_copy(update={"steps": 2, "learned_prior": False})
    assert train_predictor(config, data, held, tmp_path / "plain")
    weights = torch.load(tmp_path / "plain" / "last.pt", weights_only=True)["model"]
    expected = [v for k, v in weights.items() if k.startswith("prior.1.")]
    assert len(expected) == 2 and not any(v.any() for v in expected)
    learned = config.model_copy(update={"start_from": str(trained)})
    with pytest.raises(InvalidArgument, match="learned prior"):
        train_predictor(learned, data, held, tmp_path / "from_learned")


def test_resuming_with_another_config_is_refused(trained):
    other = SMALL.model_copy(update={"kl_weight": 1.0})
    with pytest.raises(InvalidArgument, match="kl_weight"):
        train_predictor(other, gliding_frames(), gliding_frames(seed=1), trained)
    assert json.loads((trained / "config.json").read_text())["kl_weight"] == SMALL.kl_weight


def test_a_run_of_a_time_before_a_setting_resumes_with_its_default(trained):
    path = trained / "config.json"
    known = json.loads(path.read_text())
    path.write_text(json.dumps({k: v for k, v in known.items() if k != "representation"}))
    other = SMALL.model_copy(update={"representation": "body"})
    with pytest.raises(InvalidArgument, match="representation"):
        train_predictor(other, gliding_frames(), gliding_frames(seed=1), trained)
    assert train_predictor(SMALL, gliding_frames(), gliding_frames(seed=1), trained)
    assert json.loads(path.read_text()) == known


@pytest.mark.parametrize("representation", ["body", "humor"])
def test_body_parameters_are_learned_by_their_markers(representation, tmp_path):
    data, held = walking_frames(), walking_frames(seed=1)
    config = SMALL.model_copy(update={"representation": representation, "rollout": 2, "steps": 40})
    before = PredictorTrainer(config, data, held).validate()
    assert train_predictor(config, data, held, tmp_path / "run")
    last = (tmp_path / "run" / "log.txt").read_text().splitlines()[-1]
    error = float(last.split("val/posterior_cm")[1].split()[0])
    assert error < 0.7 * before["val/posterior_cm"]


def test_body_parameters_are_not_served():
    config = SMALL.model_copy(update={"representation": "body", "regressors": {"male": "x"}})
    with pytest.raises(InvalidArgument, match="are markers, not 'body'"):
        PredictorTrainer(config, gliding_frames(), gliding_frames(seed=1))


def test_a_stopped_run_equals_one_that_was_not(tmp_path):
    """Stopping by the time limit and resuming changes nothing: state and chance are saved."""
    data, held = gliding_frames(), gliding_frames(seed=1)
    config = SMALL.model_copy(update={"steps": 4})
    train_predictor(config, data, held, tmp_path / "whole")
    while not train_predictor(config, data, held, tmp_path / "parts", minutes=1e-4):
        pass
    whole, parts = (
        torch.load(tmp_path / name / "last.pt", weights_only=True) for name in ("whole", "parts")
    )
    assert whole["step"] == parts["step"] == 4
    assert all(
        torch.allclose(whole["model"][k], parts["model"][k], atol=1e-6) for k in whole["model"]
    )


def test_rollout_seeds_are_the_models_own_frames_in_the_recorded_frame():
    config = SMALL.model_copy(update={"rollout": 8})
    trainer = PredictorTrainer(config, gliding_frames(), gliding_frames(seed=1))
    starts = torch.tensor([0, 3])
    terms = list(trainer.losses(trainer.frames, starts, 8))
    assert len(terms) == 8
    errors = [float(t.reconstruction.detach()) for t in terms]
    assert errors[-1] > errors[0]  # errors of an untrained model add up


@pytest.fixture
def regressors(tmp_path):
    """Runs of untrained regressors: a body that hardly leaves its T-pose."""
    runs = {}
    for gender in GENDERS:
        network = BodyRegressor(marker_body(load_body("anny52", gender)))
        (tmp_path / gender).mkdir()
        torch.save({"model": network.state_dict()}, tmp_path / gender / "last.pt")
        runs[gender] = str(tmp_path / gender)
    return runs


def test_rollout_seeds_may_be_those_that_the_service_hands_on(regressors):
    """Half of a next seed are markers of the regressed body, of whichever gender the row is."""
    config = SMALL.model_copy(update={"rollout": 2, "regressors": regressors})
    data = gliding_frames()
    trainer = PredictorTrainer(config, data, gliding_frames(seed=1))
    starts = torch.tensor([0, 3, 95, 98])
    assert data.gender[starts].tolist() == [0, 0, 1, 1]
    begin = starts[:, None] + torch.arange(2)
    index = starts[:, None] + torch.arange(10)
    future = Markers().recorded(data, index, data.frame(starts, True)).features[:, 2:]
    assert trainer.serving is not None
    made = trainer.serving.follow(
        data, starts, data.world(starts, 2), future, data.hips[begin], data.rotations[begin]
    )
    assert made.translation.shape == (4, 8, 3)
    predicted = data.world(starts + 8, 2)
    off = (made.next_seed_markers - predicted).norm(dim=-1).mean((1, 2))
    assert (off > 0.05).all()  # the cloud of these data is no body
    some = torch.tensor([1, 2])
    alone = trainer.serving.follow(
        data, starts[some], data.world(starts[some], 2), future[some],
        data.hips[begin[some]], data.rotations[begin[some]],
    )  # fmt: skip
    assert torch.allclose(alone.next_seed_markers, made.next_seed_markers[some], atol=1e-4)
    assert len(list(trainer.losses(data, starts, 2))) == 2


def test_served_seeds_need_a_regressor_of_each_gender(regressors):
    config = SMALL.model_copy(update={"regressors": {"male": regressors["male"]}})
    with pytest.raises(InvalidArgument, match="female"):
        PredictorTrainer(config, gliding_frames(), gliding_frames(seed=1))


def test_the_shipped_recipe_starts_only_from_runs_that_it_makes():
    """Every `start_from` of a config names the run of another shipped config."""
    paths = (path.relative_to(CONFIGS) for path in CONFIGS.rglob("*.toml"))
    names = {path.with_suffix("").as_posix() for path in paths}
    for name in sorted(n for n in names if "predictor_" in n):
        start = read_config(PredictorConfig, name).start_from
        assert start.removeprefix("runs/") in names | {""}


def test_the_height_of_a_sole_counts_where_it_swings_low():
    frames = torch.zeros(3, 4, 3)  # frames, soles: one rests, one swings low, slow, one high
    frames[:, 1:3, 2] = 0.03
    frames[:, 3, 2] = 0.3
    frames[:, 1, 1] = torch.arange(3) * 0.05
    frames[:, 2, 1] = torch.arange(3) * 0.0125
    frames[:, 3, 1] = torch.arange(3) * 0.05
    truth = torch.zeros(1, 3, MARKERS, 3)
    truth[0, :, :4] = frames

    def lift(sole: int) -> float:
        made = truth.clone()
        made[0, :, sole, 2] -= 0.02
        return float(sole_lift(made.flatten(2), truth.flatten(2), torch.arange(4)))

    weights = [0.0, 1.0, 0.5, 0.0]
    expected = [0.02 * 2 * weight / (2 * sum(weights) + 1) for weight in weights]
    assert [lift(sole) for sole in range(4)] == pytest.approx(expected, abs=1e-6)
