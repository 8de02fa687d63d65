"""A served step graph as game engines want it: one file, float32, plain operators, old opset.

The served graphs share `weights.bin` (float16), choose among any number of candidates, and tell
their quality terms. Here the weights go inside as float32, the number of candidates is fixed, terms
and choice are left out, and what then is constant is computed once.
"""

import json
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator

from wayfarer.errors import ArtifactError

OPSET: Final = 15
"""The newest that Unity's older Sentis takes (7 to 15) and, from 1.11 on, every ONNX Runtime."""

IR_VERSION: Final = 8
"""As old as opset 15: older runtimes refuse newer files, whatever is in them."""

LEFT_OUT: Final = ("terms", "choice")
"""Outputs of the served graph that a host has no use for."""

AGENTS: Final = "agents"
"""The leading axis of all inputs and outputs, which stays free."""

METADATA_KEY: Final = "wayfarer_engine"

Node = onnx.NodeProto
Attributes = dict[str, Any]


def engine_graph(source: Path, candidates: int, about: dict[str, Any]) -> onnx.ModelProto:
    """The graph in `source` with `candidates` fixed; `about` goes into the metadata as JSON.

    Its leading axis is called `agents` and stays free. Raises ArtifactError when it cannot be.
    """
    model = onnx.load(source)  # with the weights in its folder
    graph = model.graph
    _embed(graph)
    _fix(graph, "candidates", candidates)
    if candidates == 1:
        _drop_choice(graph, source)
    kept = [output for output in graph.output if output.name not in LEFT_OUT]
    del graph.output[:]
    graph.output.extend(kept)
    _prune(graph)
    _fold(graph)
    _lower(model, source)
    _prune(graph)
    used = {name for node in graph.node for name in node.input}
    inputs = [value for value in graph.input if value.name in used]
    del graph.input[:], graph.value_info[:], model.metadata_props[:]
    graph.input.extend(inputs)
    graph.name = source.stem
    model.producer_name, model.producer_version = "wayfarer", ""
    model.metadata_props.add(key=METADATA_KEY, value=json.dumps(about))
    return model


def operators(model: onnx.ModelProto) -> dict[str, int]:
    """How often each operator occurs, by name."""
    return dict(sorted(Counter(node.op_type for node in model.graph.node).items()))


def shape_of(value: onnx.ValueInfoProto) -> list[int | str]:
    """Sizes of an input or output; free axes by their names."""
    sizes = value.type.tensor_type.shape.dim
    return [size.dim_param or size.dim_value for size in sizes]


def _embed(graph: onnx.GraphProto) -> None:
    """Weights inside; those kept as float16 become the float32 that their Cast makes of them."""
    for tensor in graph.initializer:
        values = numpy_helper.to_array(tensor)
        tensor.CopyFrom(numpy_helper.from_array(values, tensor.name))  # nothing external is left
    halves = {t.name: t for t in graph.initializer if t.data_type == TensorProto.FLOAT16}
    kept = []
    for node in graph.node:
        if node.op_type == "Cast" and node.input[0] in halves:
            whole = numpy_helper.to_array(halves[node.input[0]]).astype(np.float32)
            graph.initializer.append(numpy_helper.from_array(whole, node.output[0]))
        else:
            kept.append(node)
    _replace(graph, kept)


def _fix(graph: onnx.GraphProto, axis: str, size: int) -> None:
    """Gives a named axis a size, wherever it occurs."""
    for value in (*graph.input, *graph.output, *graph.value_info):
        for dim in value.type.tensor_type.shape.dim:
            if dim.dim_param == axis:
                dim.dim_value = size
    # what asks for that size is a constant now
    sizes = {v.name: shape_of(v) for v in graph.input}
    kept = []
    for node in graph.node:
        begin, end = (_attributes(node).get(name) for name in ("start", "end"))
        if node.op_type == "Shape" and begin is not None and end is not None:
            found = sizes.get(node.input[0], ["?"])[begin:end]
            if found and all(isinstance(one, int) for one in found):
                _put(graph, node.output[0], np.array(found, np.int64))
                continue
            if found == [AGENTS]:  # any input determines it; this one always exists
                node.input[0] = graph.input[0].name
        kept.append(node)
    _replace(graph, kept)


def _drop_choice(graph: onnx.GraphProto, source: Path) -> None:
    """Removes the choice from a graph of one candidate: nothing is gathered, nothing scored."""
    makers = {name: node for node in graph.node for name in node.output}
    users: dict[str, list[Node]] = {}
    for node in graph.node:
        for name in node.input:
            users.setdefault(name, []).append(node)
    if "choice" not in makers:
        raise ArtifactError(f"{source}: has no output choice; export it again with this version")
    gathers, waiting = [], ["choice"]
    while waiting:  # from the choice by way of row numbers to what they pick
        for node in users.get(waiting.pop(), []):
            if node.op_type == "Gather":
                gathers.append(node)
            elif node.op_type in ("Add", "Reshape"):
                waiting += node.output
            else:
                raise ArtifactError(f"{source}: the choice goes into {node.op_type}, unexpectedly")
    if len(gathers) != len(LEFT_OUT):  # the future of the markers, and the terms
        raise ArtifactError(f"{source}: the choice picks {len(gathers)} tensors; expected 2")
    for gather in gathers:
        picked = gather.input[0]
        gather.CopyFrom(helper.make_node("Identity", [picked], list(gather.output)))


def _prune(graph: onnx.GraphProto) -> None:
    """Drops nodes and weights that no output needs, and nodes that do nothing."""
    names = {output.name for output in graph.output}
    same: dict[str, str] = {}
    kept = []
    for node in graph.node:
        for place, name in enumerate(node.input):
            node.input[place] = same.get(name, name)
        if node.op_type == "Identity" and node.output[0] not in names:
            same[node.output[0]] = node.input[0]
        else:
            kept.append(node)
    needed = set(names)
    found = []
    for node in reversed(kept):
        if needed.intersection(node.output):
            needed.update(node.input)
            found.append(node)
    _replace(graph, found[::-1])
    weights = [tensor for tensor in graph.initializer if tensor.name in needed]
    del graph.initializer[:]
    graph.initializer.extend(weights)


def _fold(graph: onnx.GraphProto) -> None:
    """Computes at once what depends on weights alone."""
    known = {t.name: numpy_helper.to_array(t) for t in graph.initializer}
    outputs = {output.name for output in graph.output}
    kept = []
    for node in graph.node:
        inputs = [name for name in node.input if name]
        if not all(name in known for name in inputs) or outputs.intersection(node.output):
            kept.append(node)
            continue
        values = ReferenceEvaluator(node).run(None, {name: known[name] for name in inputs})
        for name, value in zip(node.output, values, strict=True):
            known[name] = np.asarray(value)
            _put(graph, name, known[name])
    _replace(graph, kept)


def _lower(model: onnx.ModelProto, source: Path) -> None:
    """Writes the newer forms of operators as opset 15 has them. Raises ArtifactError."""
    graph = model.graph
    constants = {t.name: numpy_helper.to_array(t) for t in graph.initializer}
    ranks = _ranks(model)
    for node in graph.node:
        lower = _LOWER.get(node.op_type)
        if lower is not None:
            lower(graph, node, constants, ranks)
        del node.metadata_props[:]
        node.doc_string = ""
        schema = onnx.defs.get_schema(node.op_type, OPSET)
        unknown = set(_attributes(node)) - set(schema.attributes)
        if unknown or len(node.input) > schema.max_input:
            raise ArtifactError(
                f"{source}: {node.op_type} has {sorted(unknown) or 'more inputs'} that opset "
                f"{OPSET} does not know"
            )
    del model.opset_import[:]
    model.opset_import.append(helper.make_opsetid("", OPSET))
    model.ir_version = IR_VERSION


Constants = dict[str, NDArray[Any]]
Lower = Callable[[onnx.GraphProto, Node, Constants, dict[str, int]], None]


def _lower_reduce(
    graph: onnx.GraphProto, node: Node, constants: Constants, ranks: dict[str, int]
) -> None:
    """Before opset 18 axes are an attribute."""
    attributes = _attributes(node)
    attributes.pop("noop_with_empty_axes", None)
    if len(node.input) > 1:
        attributes["axes"] = [int(axis) for axis in np.atleast_1d(constants[node.input[1]])]
    _rewrite(node, [node.input[0]], attributes)


def _lower_split(
    graph: onnx.GraphProto, node: Node, constants: Constants, ranks: dict[str, int]
) -> None:
    """Before opset 18 a split without sizes is an even one."""
    attributes = _attributes(node)
    attributes.pop("num_outputs", None)
    _rewrite(node, list(node.input), attributes)


def _lower_pad(
    graph: onnx.GraphProto, node: Node, constants: Constants, ranks: dict[str, int]
) -> None:
    """Before opset 18 every axis is padded."""
    if len(node.input) < 4:
        return
    rank, pads = ranks[node.input[0]], constants[node.input[1]]
    axes = [int(axis) % rank for axis in constants[node.input[3]]]
    whole = np.zeros(2 * rank, np.int64)
    for place, axis in enumerate(axes):
        whole[axis], whole[rank + axis] = pads[place], pads[len(axes) + place]
    name = f"{node.output[0]}.pads"
    _put(graph, name, whole)
    value = [node.input[2]] if node.input[2] else []
    _rewrite(node, [node.input[0], name, *value], _attributes(node))


def _lower_reshape(
    graph: onnx.GraphProto, node: Node, constants: Constants, ranks: dict[str, int]
) -> None:
    """A shape without zeros needs no word on what zeros mean."""
    shape = constants.get(node.input[1])
    if shape is not None and (shape != 0).all():
        _rewrite(node, list(node.input), {})


_LOWER: Final[dict[str, Lower]] = {
    **dict.fromkeys(("ReduceMean", "ReduceMax", "ReduceMin"), _lower_reduce),
    "Split": _lower_split,
    "Pad": _lower_pad,
    "Reshape": _lower_reshape,
}


def _ranks(model: onnx.ModelProto) -> dict[str, int]:
    inferred = onnx.shape_inference.infer_shapes(model)
    values = (*inferred.graph.value_info, *inferred.graph.input)
    found = {value.name: len(value.type.tensor_type.shape.dim) for value in values}
    return found | {tensor.name: len(tensor.dims) for tensor in model.graph.initializer}


def _rewrite(node: Node, inputs: Iterable[str], attributes: Attributes) -> None:
    kind, name, outputs = node.op_type, node.name, list(node.output)
    node.CopyFrom(helper.make_node(kind, list(inputs), outputs, name=name, **attributes))


def _attributes(node: Node) -> Attributes:
    return {a.name: helper.get_attribute_value(a) for a in node.attribute}


def _put(graph: onnx.GraphProto, name: str, values: NDArray[Any]) -> None:
    graph.initializer.append(numpy_helper.from_array(values, name))


def _replace(graph: onnx.GraphProto, nodes: Iterable[Node]) -> None:
    kept = [onnx.NodeProto.FromString(node.SerializeToString()) for node in nodes]
    del graph.node[:]
    graph.node.extend(kept)
