"""The torch engine moves the shipped model as onnxruntime does, in batches of any size."""

from dataclasses import fields

import numpy as np
import pytest
import torch

from tests.engines.standing import standing_inputs
from wayfarer.engines.choice import open_engine
from wayfarer.engines.engine import StepOutputs, variant
from wayfarer.engines.padding import part
from wayfarer.engines.torch.engine import TorchEngine, load_networks
from wayfarer.errors import InvalidArgument
from wayfarer.spec import GENDERS

ROWS = 6
GENDER = "female"
needs_gpu = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
NAMES = [field.name for field in fields(StepOutputs)]


@pytest.fixture(scope="module")
def engine(networks):
    return TorchEngine(networks, batch_sizes=(8,))


@pytest.fixture(scope="module")
def inputs():
    return standing_inputs(GENDER, ROWS)


def largest_difference(found: StepOutputs, expected: StepOutputs) -> float:
    return max(float(np.abs(getattr(found, n) - getattr(expected, n)).max()) for n in NAMES)


def same(found: StepOutputs, expected: StepOutputs) -> bool:
    return all(np.array_equal(getattr(found, n), getattr(expected, n)) for n in NAMES)


@pytest.mark.parametrize("gender", GENDERS)
def test_it_gives_what_onnxruntime_gives(onnx, engine, gender):
    given = standing_inputs(gender, ROWS, candidates=3)
    assert largest_difference(engine.step(gender, given), onnx.step(gender, given)) < 1e-4


def test_outputs_have_the_types_and_shapes_of_the_interface(onnx, engine, inputs):
    found, expected = engine.step(GENDER, inputs), onnx.scoring.step(GENDER, inputs)
    for name in NAMES:
        values, wanted = getattr(found, name), getattr(expected, name)
        assert (values.shape, values.dtype) == (wanted.shape, wanted.dtype)
        assert values.flags.c_contiguous


def test_rows_of_one_padded_size_do_not_depend_on_their_batch(engine, inputs):
    whole = engine.step(GENDER, inputs)
    engine.step(GENDER, standing_inputs(GENDER, 8, seed=2))  # the content of the padding
    some = engine.step(GENDER, part(inputs, 2, 5))
    for name in NAMES:
        assert np.array_equal(getattr(whole, name)[2:5], getattr(some, name))


def test_rows_of_other_sizes_differ_in_the_last_bits_only(networks, engine, inputs):
    other = TorchEngine(networks, batch_sizes=(2,))  # and in turns of two
    assert largest_difference(other.step(GENDER, inputs), engine.step(GENDER, inputs)) < 1e-4


def test_what_it_gave_is_not_written_over(engine, inputs):
    first = engine.step(GENDER, inputs)
    kept = first.rotations.copy()
    engine.step(GENDER, standing_inputs(GENDER, ROWS, seed=3))
    assert np.array_equal(first.rotations, kept)


def test_inputs_are_not_written_to(engine, inputs):
    kept = inputs.noise.copy()
    engine.step(GENDER, inputs)
    assert np.array_equal(inputs.noise, kept)


def test_alone_it_is_the_same_engine(engine, inputs):
    assert same(engine.single_threaded.step(GENDER, inputs), engine.step(GENDER, inputs))
    assert (engine.single_threaded.kind, engine.single_threaded.graphs) == (
        engine.kind,
        engine.graphs,
    )


def test_it_names_what_it_runs_apart_from_the_graphs_it_was_made_of(models, onnx, engine):
    """Its last bits differ from other engines', so no other engine may replay its logs."""
    assert engine.graphs == tuple(variant(engine.kind, graph) for graph in onnx.graphs)
    assert engine.name == models.name


def test_warm_up_tells_of_every_size(networks):
    told = []
    engine = TorchEngine(networks, batch_sizes=(1, 2))
    engine.warm_up((1, 2), (1,), lambda agents, candidates, s: told.append((agents, candidates)))
    assert told == [(2, 1), (2, 1), (1, 1), (1, 1)], "a call for each gender"


@pytest.mark.skipif(torch.cuda.is_available(), reason="a GPU is here")
def test_a_server_without_a_gpu_is_told_what_to_choose_instead(models):
    with pytest.raises(InvalidArgument, match=r"finds none here.*onnxruntime"):
        open_engine(models, "torch", 1)


def test_a_server_without_torch_is_told_how_to_get_it(models, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "wayfarer.engines.torch.engine", None)
    with pytest.raises(InvalidArgument, match=r"\[gpu\]"):
        open_engine(models, "torch", 1)


@needs_gpu
@pytest.mark.parametrize(("precision", "off"), [("float32", 1e-4), ("tf32", 5e-3)])
def test_on_a_gpu_it_gives_what_onnxruntime_gives(models, onnx, inputs, precision, off):
    engine = TorchEngine(load_networks(models, precision=precision), batch_sizes=(8, 64))
    expected = onnx.step(GENDER, inputs)
    for _ in range(2):  # recorded, and run again
        assert largest_difference(engine.step(GENDER, inputs), expected) < off


@needs_gpu
def test_on_a_gpu_rows_of_one_padded_size_keep_their_bits(models):
    engine = TorchEngine(load_networks(models), batch_sizes=(256,))
    inputs = standing_inputs(GENDER, 200, candidates=2)
    whole = engine.step(GENDER, inputs)
    some = engine.step(GENDER, part(inputs, 50, 90))
    assert same(engine.step(GENDER, inputs), whole)
    for name in NAMES:
        assert np.array_equal(getattr(whole, name)[50:90], getattr(some, name))
