"""Counting matrix products in a graph."""

import numpy as np
import onnx
import pytest
from benchmarks.flops import Product, products
from onnx import TensorProto, helper, numpy_helper


def saved(path, nodes, inputs, outputs, weights):
    """A graph of float tensors."""
    graph = helper.make_graph(
        nodes,
        "graph",
        [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in inputs.items()],
        [helper.make_tensor_value_info(n, TensorProto.FLOAT, s) for n, s in outputs.items()],
        [numpy_helper.from_array(np.ones(s, np.float32), n) for n, s in weights.items()],
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 20)]), path)
    return path


@pytest.fixture
def path(tmp_path):
    return tmp_path / "graph.onnx"


def test_weights_multiply_all_rows_at_once(path):
    node = helper.make_node("MatMul", ["x", "w"], ["y"])
    saved(path, [node], {"x": ["agents", 8, 16]}, {"y": ["agents", 8, 4]}, {"w": [16, 4]})
    (found,) = products(path, agents=32)
    assert found == Product(m=32 * 8, k=16, n=4)
    assert found.flops == 2 * 32 * 8 * 16 * 4


def test_batches_of_small_matrices_are_told_apart(path):
    node = helper.make_node("MatMul", ["x", "z"], ["y"])
    shapes = {"x": ["agents", 22, 3, 3], "z": ["agents", 22, 3, 3]}
    saved(path, [node], shapes, {"y": ["agents", 22, 3, 3]}, {})
    assert products(path, agents=5) == [Product(3, 3, 3, count=110)]


def test_gemm_may_turn_its_matrices(path):
    node = helper.make_node("Gemm", ["x", "w"], ["y"], transA=1, transB=1)
    saved(path, [node], {"x": [16, "agents"]}, {"y": ["agents", 4]}, {"w": [4, 16]})
    assert products(path, agents=7) == [Product(7, 16, 4)]


def test_shapes_are_followed_through_what_lies_between(path):
    nodes = [
        helper.make_node("Transpose", ["w"], ["turned"], perm=[1, 0]),
        helper.make_node("Relu", ["x"], ["h"]),
        helper.make_node("MatMul", ["h", "turned"], ["y"]),
    ]
    saved(path, nodes, {"x": ["agents", 16]}, {"y": ["agents", 4]}, {"w": [4, 16]})
    assert products(path, agents=7) == [Product(7, 16, 4)]


def test_a_product_of_unknown_shape_is_refused(path):
    nodes = [
        helper.make_node("NonZero", ["x"], ["places"]),
        helper.make_node("Cast", ["places"], ["floats"], to=TensorProto.FLOAT),
        helper.make_node("MatMul", ["floats", "w"], ["y"]),
    ]
    saved(path, nodes, {"x": ["agents"]}, {"y": [1, 4]}, {"w": [16, 4]})
    with pytest.raises(ValueError, match="not known"):
        products(path, agents=3)


def test_an_operator_that_multiplies_in_another_way_is_refused(path):
    node = helper.make_node("Einsum", ["x", "w"], ["y"], equation="ab,bc->ac")
    saved(path, [node], {"x": ["agents", 16]}, {"y": ["agents", 4]}, {"w": [16, 4]})
    with pytest.raises(ValueError, match="Einsum"):
        products(path, agents=3)
