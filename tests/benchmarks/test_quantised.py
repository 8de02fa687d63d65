"""The loss of accuracy with int8: the products that use it, and how errors are counted."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from benchmarks import quantised
from wayfarer.engines.dummy import dummy_inputs
from wayfarer.engines.engine import StepOutputs
from wayfarer.engines.padding import pick

AGENTS = 6


@pytest.fixture
def path(tmp_path):
    """y = tanh(x · policy + tanh(x · policy)) · regressor; the policy's weights are prepared."""
    random = np.random.default_rng(1)
    weights = {
        "policy.weight": random.normal(size=(16, 8)).astype(np.float16),
        "regressor.weight": random.normal(size=(16, 4)).astype(np.float32),
        "one": np.ones(8, np.float32),
    }
    nodes = [
        helper.make_node("Cast", ["policy.weight"], ["full"], to=TensorProto.FLOAT),
        helper.make_node("Transpose", ["full"], ["turned"], perm=[1, 0]),
        helper.make_node("Mul", ["x", "one"], ["scaled"]),
        helper.make_node("MatMul", ["scaled", "turned"], ["before"], "first"),
        helper.make_node("Tanh", ["before"], ["computed"]),
        helper.make_node("Gemm", ["scaled", "turned", "computed"], ["sum"], "second"),
        helper.make_node("Tanh", ["sum"], ["hidden"]),
        helper.make_node("MatMul", ["hidden", "regressor.weight"], ["y"], "third"),
        helper.make_node("MatMul", ["x", "other"], ["z"], "of what is computed"),
    ]
    shapes = {"x": ["agents", 8], "other": [8, 3]}
    graph = helper.make_graph(
        nodes,
        "graph",
        [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in shapes.items()],
        [
            helper.make_tensor_value_info("y", TensorProto.FLOAT, ["agents", 4]),
            helper.make_tensor_value_info("z", TensorProto.FLOAT, ["agents", 3]),
        ],
        [numpy_helper.from_array(array, name) for name, array in weights.items()],
    )
    made = helper.make_model(graph, ir_version=10, opset_imports=[helper.make_opsetid("", 20)])
    onnx.save(made, tmp_path / "graph.onnx")
    return tmp_path / "graph.onnx"


def feed(rows, seed):
    random = np.random.default_rng(seed)
    sizes = {"x": (rows, 8), "other": (8, 3)}
    return {name: random.normal(size=size).astype(np.float32) for name, size in sizes.items()}


def run(path, inputs):
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    return session.run(["y", "z"], inputs)


def test_products_are_told_by_the_names_of_their_weights(path):
    graph = onnx.load(path).graph
    assert quantised.products_of(graph, ["policy"]) == {"first", "second"}
    assert quantised.products_of(graph, ["policy", "regressor"]) == {"first", "second", "third"}
    assert quantised.products_of(graph, ["predictor"]) == set()


def test_what_is_computed_is_added_after_the_product(path):
    model = quantised.with_sums_apart(onnx.load(path))
    onnx.save(model, path.with_name("apart.onnx"))
    inputs = feed(AGENTS, seed=2)
    assert all(len(node.input) == 2 for node in model.graph.node if node.op_type == "Gemm")
    apart = run(path.with_name("apart.onnx"), inputs)
    for expected, found in zip(run(path, inputs), apart, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(
    ("networks", "names"),
    [(["policy"], {"first", "second"}), (["policy", "regressor"], {"first", "second", "third"})],
)
def test_the_chosen_products_are_in_int8_and_nothing_else(path, networks, names):
    target = path.with_name("int8.onnx")
    quantised.quantise(path, target, networks, [feed(64, seed) for seed in range(4)])
    graph = onnx.load(target).graph
    kinds = {tensor.name: tensor.data_type for tensor in graph.initializer}
    made = {output: node for node in graph.node for output in node.output}
    in_int8 = {
        node.name
        for node in graph.node
        if node.op_type in ("MatMul", "Gemm")
        and (source := made.get(node.input[1]))
        and kinds.get(source.input[0]) == TensorProto.INT8
    }
    assert in_int8 == names
    if not multiplies_in_int8():
        return  # its sums of products overflow, whatever was written
    inputs = feed(64, seed=9)
    for expected, found in zip(run(path, inputs), run(target, inputs), strict=True):
        assert np.abs(found - expected).mean() < 0.1


def multiplies_in_int8():
    """The processor has VNNI: without it, onnxruntime adds up pairs of products in 16 bits."""
    flags = Path("/proc/cpuinfo")
    return not flags.exists() or "vnni" in flags.read_text()


def outputs(rows, **columns):
    """Outputs of agents that stand in the middle, except for these columns."""
    upright = np.zeros((rows, 8, 22, 4), np.float32)
    upright[..., 3] = 1
    return replace(
        StepOutputs(
            translation=np.zeros((rows, 8, 3), np.float32),
            rotations=upright,
            contacts=np.ones((rows, 8, 2), np.float32),
            next_seed_markers=np.zeros((rows, 2, 67, 3), np.float32),
            terms=np.zeros((rows, 1), np.float32),
            choice=np.zeros(rows, np.int64),
        ),
        **columns,
    )


def test_errors_are_distances_and_angles_over_all_calls():
    markers = np.zeros((1, 2, 67, 3), np.float32)
    markers[0, 0, 0] = (0.003, 0, 0.004)
    turned = np.zeros((1, 8, 22, 4), np.float32)
    turned[..., 2:] = -np.sin(np.radians(1.0)), -np.cos(np.radians(1.0))  # 2°, by -q
    hips = np.full((1, 8, 3), (0, 0.002, 0), np.float32)
    other = outputs(1, next_seed_markers=markers, rotations=turned, translation=hips)
    same = (outputs(1), outputs(1))
    found = quantised.error_columns([same, (outputs(1), other)])
    assert found["markers_mm_median"] == 0
    assert found["markers_mm_max"] == pytest.approx(5)
    assert found["rotation_deg_p99"] == pytest.approx(2, rel=1e-4)
    assert found["hips_mm_p99"] == pytest.approx(2)
    assert set(quantised.error_columns([same]).values()) == {0.0}


class FromInputs:
    """An engine whose markers are those of the seed; in a dynamic scale, if that is asked for."""

    full = AGENTS

    def __init__(self, dynamic):
        self._dynamic = dynamic

    def step(self, gender, inputs):
        markers = inputs.seed_markers
        scale = np.abs(markers).max() / 127 if self._dynamic else 0.01
        return outputs(
            len(markers), next_seed_markers=(np.round(markers / scale) * scale).astype(np.float32)
        )


@pytest.fixture
def inputs():
    markers = np.random.default_rng(3).normal(size=(AGENTS, 2, 67, 3)).astype(np.float32)
    return replace(dummy_inputs(AGENTS, 1), seed_markers=markers)


@pytest.mark.parametrize("dynamic", [False, True])
def test_a_row_that_depends_on_its_batch_is_found(inputs, dynamic):
    assert quantised.has_own_rows(FromInputs(dynamic), "male", inputs) != dynamic


def test_variants_are_held_against_float32(inputs):
    engines = {quantised.FLOAT32: FromInputs(False), "int8": FromInputs(True)}
    compared = {"male": [inputs], "female": [pick(inputs, np.arange(3))]}
    rows = list(quantised.rows_of(engines, compared, rounds=2))
    assert [row["own_rows"] for row in rows] == [True, False]
    assert rows[0]["of_float32"] == 1 and rows[0]["markers_mm_max"] == 0
    assert 0 < rows[1]["markers_mm_max"] < 50
    assert list(quantised.ratios(rows)) == ["int8: time / float32"]
