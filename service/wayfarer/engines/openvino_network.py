"""How networks are changed before OpenVINO compiles them: into bfloat16, where they may be.

Hidden layers are computed in bfloat16, coordinates never. In bfloat16 a metre is exact to 4 mm, 20
m to 8 cm. OpenVINO's own hint for bfloat16 is for all of a network, and its marks for exceptions
get lost in its transformations. Therefore the types are written into the network, and the hint
stays float32: products with weights and the operations on their rows (activations, gates) are in
bfloat16. The width tells hidden layers from coordinates: it is a multiple of 128, which 201 and 135
are not.
"""

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from openvino import Model, Node, Output


HIDDEN: Final = 128
"""Widths of hidden layers are multiples of it."""

THROUGH: Final = frozenset(("Convert", "Transpose", "Split", "VariadicSplit", "Slice", "Gather"))
"""May lie between weights as they are kept and the product: a gate is cut out of its unit, and
columns are put in another order."""

ON_ROWS: Final = frozenset(
    (
        *("Add", "Subtract", "Multiply", "Tanh", "Sigmoid", "Relu", "PRelu", "LeakyRelu"),
        *("Split", "VariadicSplit"),
    )
)
"""Operators that may work on rows of hidden layers."""


def with_hidden_bfloat16(network: "Model") -> "Model":
    """The same network, changed in place."""
    for node in network.get_ordered_ops():
        if is_product(node) or is_hidden(node):
            _lower(node)
    network.validate_nodes_and_infer_types()
    return network


def is_product(node: "Node") -> bool:
    """A matrix product with the weights of a network: one side of these is hidden."""
    if node.get_type_name() != "MatMul" or not _is_float(node.output(0)):
        return False
    weights = node.input_value(1).get_node()
    while weights.get_type_name() in THROUGH:
        weights = weights.input_value(0).get_node()
    shape = node.input_value(1).get_partial_shape()
    return weights.get_type_name() == "Constant" and any(
        size.is_static and size.get_length() % HIDDEN == 0 for size in shape
    )


def is_hidden(node: "Node") -> bool:
    """Whether an operation works on rows of a hidden layer."""
    return node.get_type_name() in ON_ROWS and all(
        _is_float(value) and _is_row(value) for value in (node.input_value(0), *node.outputs())
    )


def _lower(node: "Node") -> None:
    """Makes a node work in bfloat16, between conversions."""
    from openvino import Type
    from openvino import opset13 as ops

    for index, value in enumerate(node.input_values()):
        node.set_argument(index, _lowered(value))
    node.validate_and_infer_types()
    for output in node.outputs():
        readers = list(output.get_target_inputs())
        full = ops.convert(output, Type.f32).output(0)
        for reader in readers:
            reader.replace_source_output(full)


def _lowered(value: "Output") -> "Output":
    """A value in bfloat16: without the conversion that made it a float32."""
    from openvino import Type
    from openvino import opset13 as ops

    if not _is_float(value):
        return value
    node = value.get_node()
    if node.get_type_name() == "Convert" and node.input_value(0).get_element_type() == Type.bf16:
        return node.input_value(0)
    return ops.convert(value, Type.bf16).output(0)


def _is_float(value: "Output") -> bool:
    return bool(value.get_element_type().to_dtype() == np.float32)


def _is_row(value: "Output") -> bool:
    shape = value.get_partial_shape()
    width = shape[len(shape) - 1] if len(shape) else None
    return (
        width is not None
        and len(shape) == 2
        and width.is_static
        and (width.get_length() % HIDDEN == 0)
    )
