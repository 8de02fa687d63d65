import onnx
import onnxruntime as ort
import torch
from torch import nn

from wayfarer_lab.onnx_files import WEIGHTS_FILE, WeightStore
from wayfarer_lab.training.export import parity, round_to_half, save_graph
from wayfarer_lab.training.graphs import ExportGraph


def small_graph(seed: int) -> ExportGraph:
    torch.manual_seed(seed)
    module = round_to_half(nn.Sequential(nn.Linear(40, 40), nn.Tanh(), nn.Linear(40, 40)))
    return ExportGraph(module, {"x": torch.randn(3, 40)}, ("y",), {"x": ("rows",)})


def test_graphs_share_equal_weights_and_give_the_same_numbers(tmp_path):
    store = WeightStore()
    first, again, other = small_graph(0), small_graph(0), small_graph(1)
    for name, graph in (("a", first), ("b", again), ("c", other)):
        save_graph(graph, tmp_path / f"{name}.onnx", store, name)
    store.write(tmp_path)
    one_model = 2 * 40 * 40 * 2  # two float16 matrices
    assert 2 * one_model <= (tmp_path / WEIGHTS_FILE).stat().st_size < 2.5 * one_model
    for name, graph in (("a", first), ("b", again), ("c", other)):
        wide = {"x": torch.randn(7, 40)}
        assert parity(graph.module, tmp_path / f"{name}.onnx", wide, ("y",)) < 1e-5


def test_contract_is_in_the_file(tmp_path):
    store = WeightStore()
    save_graph(small_graph(0), tmp_path / "a.onnx", store, "contract")
    store.write(tmp_path)
    session = ort.InferenceSession(str(tmp_path / "a.onnx"))
    assert session.get_modelmeta().custom_metadata_map["wayfarer"] == "contract"


def test_parity_fails_for_another_module(tmp_path):
    import pytest

    from wayfarer.errors import ArtifactError

    store = WeightStore()
    save_graph(small_graph(0), tmp_path / "a.onnx", store, "")
    store.write(tmp_path)
    other = small_graph(1)
    with pytest.raises(ArtifactError, match="differ"):
        parity(other.module, tmp_path / "a.onnx", other.inputs, ("y",))


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
