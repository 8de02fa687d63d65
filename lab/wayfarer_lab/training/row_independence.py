"""Graphs whose rows are their own: a row's result must not change with its batch, bit for bit.

Two operators of onnxruntime's CPU engine break that, in the last digit:

- `Log` takes four numbers at a time, and what is left over (the tail of an array, or of one
  thread's share of it) by another formula.
- A sum over the last axis begins with the first number on a 16-byte boundary. Where that is
  depends on the row, unless rows are a multiple of four numbers long. Three or fewer are added in
  their order.

So logarithms are taken one number at a time, and rows are padded with zeros before they are summed.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from math import prod
from pathlib import Path

import numpy as np
import onnx
import onnxruntime as ort
from numpy.typing import NDArray
from onnx import NodeProto, helper, numpy_helper

from wayfarer.errors import ArtifactError

PACKET = 4
"""Numbers that onnxruntime's builds for x86-64 and ARM add at a time."""

IN_ORDER = range(1, PACKET)
"""Largest count of numbers that are added one by one."""

SUMS = ("ReduceSum", "ReduceMean")
"""Operators that begin on such a boundary; `ReduceL2` does not."""

BATCHES = (1, 2, 3, 5, 8)
"""Rows at a time in `check_rows`."""


def make_rows_independent(model: onnx.ModelProto) -> onnx.ModelProto:
    """Rewrites the operators named above, in place. Raises ArtifactError for unknown sizes."""
    graph = model.graph
    known = [*graph.input, *graph.value_info, *graph.output]
    shapes = {v.name: [d.dim_value for d in v.type.tensor_type.shape.dim] for v in known}
    constants = {i.name: i for i in graph.initializer}
    names = (f"row_independence.{number}" for number in count())
    nodes: list[NodeProto] = []
    for node in graph.node:
        if node.op_type == "Log":
            nodes += _log(node, graph, names)
        elif node.op_type in SUMS:
            nodes += _sum(node, graph, names, shapes, constants)
        else:
            nodes.append(node)
    del graph.node[:]
    graph.node.extend(nodes)
    return model


def check_rows(path: Path, inputs: Mapping[str, NDArray[np.float32]]) -> None:
    """Runs the rows of `inputs` in smaller batches, too. Raises ArtifactError on any difference."""
    session = ort.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    rows = len(next(iter(inputs.values())))
    whole = session.run(names, dict(inputs))
    for size in BATCHES:
        for start in range(0, rows, size):
            part = slice(start, start + size)
            # Copies: a view would keep its rows where they were in memory.
            results = session.run(names, {name: v[part].copy() for name, v in inputs.items()})
            for name, expected, found in zip(names, whole, results, strict=True):
                if not np.array_equal(expected[part], found):
                    raise ArtifactError(
                        f"{path.name}: output {name}: a row is another in a batch of {size} than "
                        f"in one of {rows}; see training/row_independence.py"
                    )


def _log(node: NodeProto, graph: onnx.GraphProto, names: Iterator[str]) -> list[NodeProto]:
    """The logarithm of a sum of one number; sums are taken one by one."""
    alone, last = next(names), _constant(graph, next(names), [-1])
    return [
        helper.make_node("Unsqueeze", [node.input[0], last], [alone]),
        helper.make_node("ReduceLogSum", [alone, last], node.output, node.name, keepdims=0),
    ]


def _sum(
    node: NodeProto,
    graph: onnx.GraphProto,
    names: Iterator[str],
    shapes: Mapping[str, Sequence[int]],
    constants: Mapping[str, onnx.TensorProto],
) -> list[NodeProto]:
    where = f"{node.op_type} {node.name}"
    if len(node.input) < 2 or node.input[1] not in constants or node.input[0] not in shapes:
        raise ArtifactError(f"{where}: cannot tell which axes it sums, or how long they are")
    shape = shapes[node.input[0]]
    axes = {axis % len(shape) for axis in numpy_helper.to_array(constants[node.input[1]]).tolist()}
    summed = prod(shape[axis] for axis in axes)
    if len(shape) - 1 not in axes or summed in IN_ORDER:
        return [node]
    if not summed:  # an axis without a size
        raise ArtifactError(f"{where}: the length of axes {sorted(axes)} of {shape} is not fixed")
    if summed % PACKET == 0:
        return [node]
    padded, last = next(names), _constant(graph, next(names), [-1])
    zeros = _constant(graph, next(names), [0, -shape[-1] % PACKET])
    pad = helper.make_node("Pad", [node.input[0], zeros, "", last], [padded])
    mean = node.op_type == "ReduceMean"
    total = next(names) if mean else node.output[0]
    work = helper.make_node("ReduceSum", [padded, node.input[1]], [total], node.name)
    work.attribute.extend(node.attribute)
    if not mean:
        return [pad, work]
    number = numpy_helper.from_array(np.array(summed, np.float32), next(names))
    graph.initializer.append(number)
    return [pad, work, helper.make_node("Div", [total, number.name], node.output)]


def _constant(graph: onnx.GraphProto, name: str, values: Sequence[int]) -> str:
    graph.initializer.append(numpy_helper.from_array(np.array(values, np.int64), name))
    return name
