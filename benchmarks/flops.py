"""Operations of a graph's matrix products, counted from its shapes."""

from dataclasses import dataclass
from math import prod
from pathlib import Path

import onnx
from onnx import shape_inference

PRODUCTS = ("MatMul", "Gemm")

UNCOUNTED = ("Einsum", "GRU", "LSTM", "RNN", "Conv", "Attention", "If", "Loop", "Scan")
"""Operators that multiply, or may contain such operators."""


@dataclass(frozen=True)
class Product:
    """Matrix products of [m, k] by [k, n], with their number."""

    m: int
    k: int
    n: int
    count: int = 1

    @property
    def flops(self) -> int:
        """Operations: a multiplication and an addition each."""
        return 2 * self.count * self.m * self.k * self.n


def products(path: Path, **sizes: int) -> list[Product]:
    """The matrix products of an ONNX graph whose named dimensions have these sizes.

    Raises ValueError for an operator that cannot be counted, since the sum would be wrong.
    """
    model = onnx.load(path)
    if found := {node.op_type for node in model.graph.node} & set(UNCOUNTED):
        raise ValueError(f"{path}: {', '.join(sorted(found))}: not counted here, and should be")
    for value in (*model.graph.input, *model.graph.output):
        for dimension in value.type.tensor_type.shape.dim:
            if dimension.dim_param:
                dimension.dim_value = sizes[dimension.dim_param]
    del model.graph.value_info[:]
    graph = shape_inference.infer_shapes(model, strict_mode=True, data_prop=True).graph
    shapes = {v.name: _dims(v) for v in (*graph.input, *graph.output, *graph.value_info)}
    shapes |= {weights.name: list(weights.dims) for weights in graph.initializer}
    return [_product(node, shapes) for node in graph.node if node.op_type in PRODUCTS]


def _product(node: onnx.NodeProto, shapes: dict[str, list[int]]) -> Product:
    left, right = (shapes.get(name, [0]) for name in node.input[:2])
    if not all((*left, *right)):
        raise ValueError(f"{node.op_type} {node.name}: shapes {left} x {right} are not known")
    if node.op_type == "Gemm":
        turned = {a.name: a.i for a in node.attribute if a.name in ("transA", "transB")}
        left = left[::-1] if turned.get("transA") else left
        right = right[::-1] if turned.get("transB") else right
    if len(right) == 2:  # one matrix, as weights are: all rows at once
        return Product(prod(left[:-1]), left[-1], right[-1])
    return Product(left[-2], left[-1], right[-1], max(prod(left[:-2]), prod(right[:-2])))


def _dims(value: onnx.ValueInfoProto) -> list[int]:
    return [dimension.dim_value for dimension in value.type.tensor_type.shape.dim]
