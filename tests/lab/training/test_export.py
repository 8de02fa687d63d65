"""The whole step as a graph: the exported file is run against torch."""

from unittest.mock import patch

import onnx
import pytest
import torch

from wayfarer.body.library import load_body
from wayfarer.engines.engine import LEFT_OUT
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import ArtifactError
from wayfarer.models.artifacts import contract_for, contract_to_json, read_contract
from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer.motion import regressor as motion_regressor
from wayfarer.motion.policy import GoalPolicy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.quality import Sites
from wayfarer.motion.regressor import BodyRegressor
from wayfarer_lab.onnx_files import WEIGHTS_FILE, WeightStore, without_scores
from wayfarer_lab.training.export import (
    TOLERANCE,
    check_graph,
    check_unscored,
    identity,
    round_to_half,
    save_graph,
    write_graph,
)
from wayfarer_lab.training.graphs import step_graph


def small_step(seed: int) -> PrimitiveStep:
    """The shipped step, whose regressor has one block in place of ten that are alike."""
    torch.manual_seed(seed)
    body = load_body("anny52", "male")
    skin = marker_body(body)
    policy = GoalPolicy()
    torch.nn.init.normal_(policy.output.weight, std=0.05)  # it begins as the prior
    with patch.object(motion_regressor, "BLOCKS", 1):
        regressor = BodyRegressor(skin)
    networks = (MarkerPredictor(2, at_once=8), regressor, policy)
    predictor, regressor, policy = map(round_to_half, networks)
    sites = Sites.from_names(body.marker_names)
    return PrimitiveStep(predictor, regressor, skin, sites, policy).eval()


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    graph, store = step_graph(small_step(0)), WeightStore()
    contract = contract_for("step_male.onnx", "test", identity("anny52", "male"))
    save_graph(graph, folder / "step_male.onnx", store, contract_to_json(contract))
    store.write(folder)
    return graph, folder / "step_male.onnx"


def test_torch_and_onnx_agree_over_batches_candidates_and_bodies(exported):
    graph, path = exported
    assert check_graph(path, graph) < TOLERANCE


def test_the_file_carries_its_contract(exported):
    _, path = exported
    assert read_contract(path) == contract_for("step_male.onnx", "test", identity("anny52", "male"))


def test_another_networks_file_is_refused(exported):
    _, path = exported
    with pytest.raises(ArtifactError, match=r"differ|alike"):
        check_graph(path, step_graph(small_step(1)))


def test_a_graph_without_scores_moves_alike(tmp_path):
    scored, shipped = (DEFAULT_MODEL / f"{kind}_male.onnx" for kind in ("step", "unscored"))
    (tmp_path / WEIGHTS_FILE).write_bytes((DEFAULT_MODEL / WEIGHTS_FILE).read_bytes())
    made = without_scores(onnx.load(scored, load_external_data=False))
    assert {output.name for output in made.graph.output}.isdisjoint(LEFT_OUT)
    write_graph(made, tmp_path / shipped.name, contract_to_json(read_contract(shipped)))
    assert (tmp_path / shipped.name).read_bytes() == shipped.read_bytes()
    check_unscored(scored, shipped)
    last = next(node for node in made.graph.node if "translation" in node.output)
    last.output[:] = ["place"]
    made.graph.node.append(onnx.helper.make_node("Neg", ["place"], ["translation"]))
    write_graph(made, tmp_path / shipped.name, "")
    with pytest.raises(ArtifactError, match=r"output translation differs"):
        check_unscored(scored, tmp_path / shipped.name)
