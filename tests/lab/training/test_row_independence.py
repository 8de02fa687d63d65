import numpy as np
import onnx
import onnxruntime as ort
import pytest
from onnx import TensorProto, helper, numpy_helper

from wayfarer.errors import ArtifactError
from wayfarer_lab.training.row_independence import check_rows, make_rows_independent


def graph(operator: str, shape: list[int | str], axes: list[int] | None = None, **attributes):
    inputs, constants = ["x"], []
    if axes is not None:
        inputs.append("axes")
        constants = [numpy_helper.from_array(np.array(axes, np.int64), "axes")]
    made = helper.make_graph(
        [helper.make_node(operator, inputs, ["y"], **attributes)],
        "g",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, None)],
        constants,
    )
    return helper.make_model(made, opset_imports=[helper.make_opsetid("", 20)], ir_version=10)


def run(model, x):
    session = ort.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return session.run(None, {"x": x})[0]


def numbers(*shape: int):
    return np.random.default_rng(0).uniform(0.01, 3, shape).astype(np.float32)


CASES = {
    "Log": (graph("Log", ["rows", 9]), lambda x: np.log(x)),
    "ReduceMean": (graph("ReduceMean", ["rows", 67], [-1], keepdims=0), lambda x: x.mean(-1)),
    "ReduceSum": (graph("ReduceSum", ["rows", 11], [1]), lambda x: x.sum(-1, keepdims=True)),
    "two axes": (
        graph("ReduceMean", ["rows", 3, 9], [-1, -2], keepdims=0),
        lambda x: x.mean((-1, -2)),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_result_stays_and_rows_become_independent(case, tmp_path):
    model, expected = CASES[case]
    sizes = [d.dim_value for d in model.graph.input[0].type.tensor_type.shape.dim][1:]
    x, path = numbers(15, *sizes), tmp_path / "graph.onnx"
    path.write_bytes(model.SerializeToString())
    with pytest.raises(ArtifactError, match=r"graph.onnx: output y: a row is another in a batch"):
        check_rows(path, {"x": x})

    rewritten = onnx.ModelProto.FromString(model.SerializeToString())
    make_rows_independent(rewritten)
    np.testing.assert_allclose(run(rewritten, x), expected(x), rtol=1e-5, atol=1e-6)
    path.write_bytes(rewritten.SerializeToString())
    check_rows(path, {"x": x})


@pytest.mark.parametrize(
    "model",
    [
        graph("ReduceMean", ["rows", 8], [-1]),  # whole packets
        graph("ReduceSum", ["rows", 3], [-1]),  # too few to be taken together
        graph("ReduceMean", ["rows", 7, 5], [1]),  # column by column: always in order
        graph("ReduceL2", ["rows", 7], [-1]),
        graph("Exp", ["rows", 7]),
    ],
)
def test_what_is_independent_already_stays_as_it_is(model):
    before = model.SerializeToString()
    assert make_rows_independent(model).SerializeToString() == before


def test_a_sum_over_an_axis_of_unknown_length_is_refused():
    with pytest.raises(ArtifactError, match=r"ReduceSum .*is not fixed"):
        make_rows_independent(graph("ReduceSum", ["rows", "columns"], [-1]))
