from importlib.util import find_spec

import pytest

from wayfarer.engines import choice
from wayfarer.engines.choice import open_engine
from wayfarer.engines.onnx_engine import OnnxEngine
from wayfarer.engines.openvino_engine import OpenVinoEngine
from wayfarer.errors import InvalidArgument
from wayfarer.models.bundle import DEFAULT_MODEL, load_models

needs_openvino = pytest.mark.skipif(find_spec("openvino") is None, reason="needs OpenVINO")


@pytest.fixture(scope="module")
def models():
    return load_models(DEFAULT_MODEL)


def test_onnxruntime_is_taken_where_it_is_asked_for_or_alone(models, monkeypatch):
    assert isinstance(open_engine(models, "onnxruntime", 1), OnnxEngine)
    monkeypatch.setattr(choice, "find_spec", lambda name: None)
    assert isinstance(open_engine(models, "auto", 1), OnnxEngine)


@needs_openvino
@pytest.mark.parametrize(("seconds", "chosen"), [(0.1, OpenVinoEngine), (0.9, OnnxEngine)])
def test_the_faster_engine_is_chosen_where_it_is_clearly_faster(
    models, monkeypatch, seconds, chosen
):
    times = {"onnxruntime": 1.0}
    monkeypatch.setattr(choice, "trial", lambda engine: times.get(engine.kind, seconds))
    assert isinstance(open_engine(models, "auto", 1), chosen)


def test_memory_for_a_network_of_each_number_of_candidates_is_not_taken_unasked(models):
    assert isinstance(open_engine(models, "auto", 1, candidates=4), OnnxEngine)


def test_a_trial_takes_time(models):
    assert choice.trial(OnnxEngine(models, 1)) > 0


def test_an_engine_that_is_not_installed_is_named(models, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "openvino", None)
    with pytest.raises(InvalidArgument, match="pip install"):
        open_engine(models, "openvino", 1)


def test_a_server_warms_the_sizes_it_can_need(models):
    engine = OnnxEngine(models, 1)
    assert engine.sizes_for(5) == (1, 2, 4, 6)
    assert engine.sizes_for(10_000) == engine.batch_sizes
