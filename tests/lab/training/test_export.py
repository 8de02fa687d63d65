"""A graph that is exported here and the shipped step are run against torch.

To export a step takes two minutes of a core. `wayfarer export` does it whenever a model is made,
and checks it as here.
"""

import onnx
import pytest
import torch

from wayfarer.engines.engine import LEFT_OUT
from wayfarer.engines.torch.weights import load_step
from wayfarer.errors import ArtifactError
from wayfarer.models.artifacts import contract_for, contract_to_json, read_contract
from wayfarer.models.bundle import DEFAULT_MODEL, load_models
from wayfarer.motion.policy import TrajectoryPolicy
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
from wayfarer_lab.training.graphs import policy_graph, step_graph


def random_policy(seed: int) -> TrajectoryPolicy:
    torch.manual_seed(seed)
    policy = TrajectoryPolicy()
    torch.nn.init.normal_(policy.net[-1].weight, std=0.05)  # it begins as the prior
    return round_to_half(policy)


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    graph, store = policy_graph(random_policy(0)), WeightStore()
    contract = contract_for("policy.onnx", "test", identity("anny52", "male"))
    save_graph(graph, folder / "policy.onnx", store, contract_to_json(contract))
    store.write(folder)
    return graph, folder / "policy.onnx"


def test_torch_and_onnx_agree(exported):
    graph, path = exported
    assert check_graph(path, graph) < TOLERANCE


def test_the_shipped_step_is_torchs_over_batches_candidates_and_bodies():
    graph = step_graph(load_step(load_models(DEFAULT_MODEL), "male", "float32"))
    assert check_graph(DEFAULT_MODEL / "step_male.onnx", graph) < TOLERANCE
    with pytest.raises(ArtifactError, match=r"differ|alike"):
        check_graph(DEFAULT_MODEL / "step_female.onnx", graph)


def test_the_file_carries_its_contract(exported):
    _, path = exported
    assert read_contract(path) == contract_for("policy.onnx", "test", identity("anny52", "male"))


def test_another_networks_file_is_refused(exported):
    _, path = exported
    with pytest.raises(ArtifactError, match="differ"):
        check_graph(path, policy_graph(random_policy(1)))


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
