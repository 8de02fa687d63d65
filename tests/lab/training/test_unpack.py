"""Run folders made of the shipped model hold its weights."""

import json

import onnxruntime
import pytest
import torch

from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import ArtifactError
from wayfarer.models.artifacts import ASSETS
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS
from wayfarer_lab.training.graphs import (
    ExportGraph,
    policy_graph,
    predictor_graph,
    regressor_graph,
)
from wayfarer_lab.training.run import load_policy, load_predictor, load_weights
from wayfarer_lab.training.unpack import read_regressor, unpack_models

MODELS = ASSETS / "models" / "gamma-anny52"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    assert unpack_models(MODELS, folder)
    return folder


def test_networks_from_unpacked_weights_do_what_the_shipped_graphs_do(runs):
    skin = marker_body(load_body("anny52", "male"))
    regressor = load_weights(BodyRegressor(skin), runs / "regressor_male")
    same_as(regressor_graph(regressor), "regressor_male.onnx")
    same_as(policy_graph(load_policy(runs / "policy")), "policy.onnx")
    for n in (1, 2):
        predictor = load_predictor(runs / f"predictor_{n}f", n)
        same_as(predictor_graph(predictor), f"predictor_{n}f.onnx")


def test_a_regressor_is_read_from_a_model_folder(tmp_path):
    for gender in GENDERS:
        same_as(regressor_graph(read_regressor(MODELS, gender)), f"regressor_{gender}.onnx")
    with pytest.raises(ArtifactError, match="cannot be read"):
        read_regressor(tmp_path, "male")


def same_as(graph: ExportGraph, file: str) -> None:
    session = onnxruntime.InferenceSession(MODELS / file)
    got = session.run(list(graph.outputs), {k: v.numpy() for k, v in graph.inputs.items()})
    with torch.no_grad():
        made = graph.module(*graph.inputs.values())
    expected = made if isinstance(made, tuple) else (made,)
    for a, b in zip(got, expected, strict=True):
        assert torch.allclose(torch.from_numpy(a), b, atol=1e-4)


def test_settings_come_from_the_card_and_a_folder_in_use_is_left_alone(runs):
    config = json.loads((runs / "regressor_female" / "config.json").read_text())
    assert config["gender"] == "female" and config["steps"] > 1
    assert unpack_models(MODELS, runs) == {}


def test_a_folder_without_graphs_is_refused(tmp_path):
    with pytest.raises(ArtifactError, match="cannot be read"):
        unpack_models(tmp_path, tmp_path / "runs")
