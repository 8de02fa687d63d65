"""OpenVINO runs the shipped model: close to onnxruntime, with independent rows."""

from dataclasses import fields

import numpy as np
import pytest

from tests.engines.standing import standing_inputs
from wayfarer.engines.compiled_networks import CompiledNetworks
from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.engines.onnx_engine import OnnxEngine
from wayfarer.engines.openvino_engine import (
    SIZES,
    UNFUSED,
    OpenVinoEngine,
    accepts,
    ends,
    open_core,
)
from wayfarer.engines.openvino_network import ON_ROWS
from wayfarer.engines.padding import part
from wayfarer.models.bundle import DEFAULT_MODEL, load_models
from wayfarer.spec import SEED_FRAMES
from wayfarer.terms import TERMS

pytest.importorskip("openvino")
ROWS = 12
GENDER = "female"


@pytest.fixture(scope="module")
def models():
    return load_models(DEFAULT_MODEL)


@pytest.fixture(scope="module")
def exact(models):
    return OpenVinoEngine(models, threads=1, bfloat16=False)


@pytest.fixture(scope="module")
def mixed(models):
    return OpenVinoEngine(models, threads=1, bfloat16=True)


@pytest.fixture(scope="module")
def inputs():
    return standing_inputs(GENDER, ROWS)


def differences(found: StepOutputs, expected: StepOutputs) -> dict[str, float]:
    return {
        f.name: float(np.abs(getattr(found, f.name) - getattr(expected, f.name)).max())
        for f in fields(StepOutputs)
    }


def test_in_float32_it_gives_what_onnxruntime_gives(models, exact, inputs):
    expected = OnnxEngine(models, 1).scoring.step(GENDER, inputs)
    off = differences(exact.scoring.step(GENDER, inputs), expected)
    assert max(off.values()) < 1e-4


def test_in_bfloat16_it_is_millimetres_off_wherever_in_the_world(models, mixed, inputs):
    far = {
        f.name: getattr(inputs, f.name) + (AWAY if f.name in PLACES else np.float32(0))
        for f in fields(StepInputs)
    }
    for given in (inputs, StepInputs(**far)):
        expected = OnnxEngine(models, 1).step(GENDER, given)
        found = mixed.step(GENDER, given)
        off = np.abs(found.next_seed_markers - expected.next_seed_markers)
        assert 0 < np.median(off) < 0.002
        assert off.max() < 0.02


PLACES = ("seed_markers", "seed_translation", "goal")
AWAY = np.array([500, -500, 0], np.float32)


@pytest.mark.parametrize("rows", [1, 3, 8, 11])
def test_rows_do_not_depend_on_their_batch(mixed, inputs, rows):
    whole = mixed.step(GENDER, inputs)
    some = mixed.step(GENDER, part(inputs, 0, rows))
    for field in fields(StepOutputs):
        assert np.array_equal(getattr(whole, field.name)[:rows], getattr(some, field.name))


def test_without_scores_one_candidate_moves_alike(mixed, inputs):
    told, silent = mixed.scoring.step(GENDER, inputs), mixed.step(GENDER, inputs)
    assert told.terms.shape == (ROWS, len(TERMS)) and told.terms.any()
    assert silent.terms.shape == (ROWS, 0)
    for name in ("translation", "rotations", "contacts", "next_seed_markers", "choice"):
        assert np.array_equal(getattr(told, name), getattr(silent, name))


def test_several_candidates_are_always_scored(exact):
    found = exact.step(GENDER, standing_inputs(GENDER, 2, 4))
    assert found.terms.shape == (2, len(TERMS))


def test_an_engine_that_scores_may_run_alone_and_the_other_way_round(mixed, inputs):
    for engine in (mixed.single_threaded.scoring, mixed.scoring.single_threaded):
        assert engine.batch_sizes == mixed.single_threaded.batch_sizes
        assert engine.step(GENDER, inputs).terms.any()
    assert not mixed.single_threaded.step(GENDER, inputs).terms.size


def test_what_it_gave_is_not_written_over(exact, inputs):
    first = exact.step(GENDER, inputs)
    kept = first.translation.copy()
    exact.step(GENDER, standing_inputs(GENDER, ROWS, seed=2))
    assert np.array_equal(first.translation, kept)


def test_more_rows_than_the_largest_size_are_taken_in_parts(exact):
    many = standing_inputs(GENDER, SIZES[-1] + 5)
    whole = exact.step(GENDER, many)
    for start, end in ((0, 16), (SIZES[-1], SIZES[-1] + 5)):
        some = exact.step(GENDER, part(many, start, end))
        assert np.array_equal(whole.rotations[start:end], some.rotations)


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (1, [1]),
        (16, [16]),
        (33, [16, 32, 33]),
        (48, [16, 32, 48]),
        (49, [49]),  # one of 128, with padding, costs less than four of 16
        (128, [128]),
        (150, [128, 144, 150]),
        (256, [128, 256]),
    ],
)
def test_rows_are_parted_into_the_sizes_there_are(rows, expected):
    assert ends(rows) == expected


def test_a_kept_network_is_used_with_the_same_bits_unless_openvino_refuses_it(
    models, mixed, inputs, tmp_path, monkeypatch
):
    unusable = CompiledNetworks(None).keep(bytes(9999))
    first = OpenVinoEngine(models, 1, True, tmp_path)
    monkeypatch.setattr(first._kept, "find", lambda *_: unusable)
    again = OpenVinoEngine(models, 1, True, tmp_path)
    monkeypatch.setattr(again, "_read", None)
    expected = mixed.step(GENDER, inputs)
    for engine in (first, again):
        found = engine.step(GENDER, inputs)
        for field in fields(StepOutputs):
            assert np.array_equal(getattr(expected, field.name), getattr(found, field.name))


def test_settings_that_this_version_does_not_know_are_left_out():
    core = open_core()
    assert accepts(core, UNFUSED) and not accepts(core, {"SNIPPETS_MOOD": "DISABLE"})


def test_alone_it_is_the_same_engine(mixed, inputs):
    assert np.array_equal(
        mixed.single_threaded.step(GENDER, inputs).rotations, mixed.step(GENDER, inputs).rotations
    )
    assert mixed.single_threaded.kind == mixed.kind


def test_only_hidden_layers_are_in_bfloat16(models, mixed):
    network = mixed._read(models.graph("step", GENDER, SEED_FRAMES), 16, 1)
    lowered = [
        (node.get_type_name(), [size.to_string() for size in node.output(0).get_partial_shape()])
        for node in network.get_ordered_ops()
        if node.output(0).get_element_type().get_type_name() == "bf16"
        and node.get_type_name() not in ("Constant", "Convert")
    ]
    kinds = {kind for kind, _ in lowered}
    assert {"MatMul", "Tanh", "Sigmoid"} <= kinds <= {"MatMul", *ON_ROWS}
    others = [shape for kind, shape in lowered if kind != "MatMul"]
    assert all(int(shape[-1]) % 128 == 0 for shape in others)
    assert len(lowered) > 100


def test_its_logs_are_not_replayed_by_another_engine(models, exact, mixed):
    stamps = {engine.graphs for engine in (OnnxEngine(models, 1), exact, mixed)}
    assert len(stamps) == 3
