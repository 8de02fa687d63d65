import onnx
import onnxruntime as ort
import pytest
import torch
from torch import nn

from wayfarer.errors import ArtifactError
from wayfarer_lab.onnx_files import WEIGHTS_FILE, WeightStore
from wayfarer_lab.training.export import parity, round_to_half, save_graph
from wayfarer_lab.training.graphs import ExportGraph


def small_graph(seed: int) -> ExportGraph:
    torch.manual_seed(seed)
    module = round_to_half(nn.Sequential(nn.Linear(40, 40), nn.Tanh(), nn.Linear(40, 40)))
    return ExportGraph(module, {"x": torch.randn(3, 40)}, ("y",), {"x": ("rows",)})


GRAPHS = {"a": small_graph(0), "b": small_graph(0), "c": small_graph(1)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three graphs, of which two are equal; the name of each is its contract."""
    made, store = tmp_path_factory.mktemp("graphs"), WeightStore()
    for name, graph in GRAPHS.items():
        save_graph(graph, made / f"{name}.onnx", store, name)
    store.write(made)
    return made


def test_graphs_share_equal_weights_and_give_the_same_numbers(folder):
    one_model = 2 * 40 * 40 * 2  # two float16 matrices
    assert 2 * one_model <= (folder / WEIGHTS_FILE).stat().st_size < 2.5 * one_model
    for name, graph in GRAPHS.items():
        wide = {"x": torch.randn(7, 40)}
        assert parity(graph.module, folder / f"{name}.onnx", wide, ("y",)) < 1e-5


def test_contract_is_in_the_file(folder):
    session = ort.InferenceSession(str(folder / "a.onnx"))
    assert session.get_modelmeta().custom_metadata_map["wayfarer"] == "a"


def test_parity_fails_for_another_module(folder):
    other = GRAPHS["c"]
    with pytest.raises(ArtifactError, match="differ"):
        parity(other.module, folder / "a.onnx", other.inputs, ("y",))


def test_values_that_half_cannot_hold_stay_float32(tmp_path):
    torch.manual_seed(0)
    module = nn.Linear(40, 40).eval()  # not rounded
    graph = ExportGraph(module, {"x": torch.randn(3, 40)}, ("y",), {"x": ("rows",)})
    store = WeightStore()
    save_graph(graph, tmp_path / "a.onnx", store, "")
    store.write(tmp_path)
    kept = onnx.load(tmp_path / "a.onnx", load_external_data=False).graph.initializer
    assert any(t.data_type == onnx.TensorProto.FLOAT and t.external_data for t in kept)
    assert parity(module, tmp_path / "a.onnx", graph.inputs, ("y",)) < 1e-6
