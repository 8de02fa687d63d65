import pytest

from tests.engines.graphs import save, step_model
from wayfarer.models.artifacts import METADATA_KEY
from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer.models.onnx_metadata import read_metadata


def test_it_reads_what_was_written(tmp_path):
    save(step_model(), tmp_path / "graph.onnx", "the contract, with a µ")
    assert read_metadata(tmp_path / "graph.onnx") == {METADATA_KEY: "the contract, with a µ"}


def test_every_shipped_graph_has_a_contract():
    graphs = list(DEFAULT_MODEL.glob("*.onnx"))
    assert graphs
    assert all(METADATA_KEY in read_metadata(graph) for graph in graphs)


def test_what_is_no_graph_is_refused(tmp_path):
    (tmp_path / "graph.onnx").write_bytes(b"not a graph")
    with pytest.raises(ValueError, match="not an ONNX file"):
        read_metadata(tmp_path / "graph.onnx")
    with pytest.raises(OSError, match="graph"):
        read_metadata(tmp_path / "no graph.onnx")
