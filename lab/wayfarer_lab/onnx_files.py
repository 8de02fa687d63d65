"""A folder of ONNX graphs that share one weight file.

The predictor is part of both genders' step graphs and is shipped on its own too: every distinct
tensor is stored once in `weights.bin`, as float16, and cast back when a graph is loaded (the
runtime folds the cast away). Weights are rounded to float16 *before* export, so this loses nothing.
"""

import hashlib
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from wayfarer.engines.engine import LEFT_OUT

WEIGHTS_FILE = "weights.bin"
SMALL = 256
"""Tensors of fewer elements stay inside their graph."""
ALIGNMENT = 64


class WeightStore:
    """Collects tensors by content."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self._places: dict[str, tuple[int, int]] = {}

    def add(self, data: bytes) -> tuple[int, int]:
        """Offset and length of these bytes in the file; the same bytes are kept once."""
        key = hashlib.sha256(data).hexdigest()
        if key not in self._places:
            self._bytes.extend(b"\0" * (-len(self._bytes) % ALIGNMENT))
            self._places[key] = (len(self._bytes), len(data))
            self._bytes.extend(data)
        return self._places[key]

    def write(self, folder: Path) -> None:
        """Writes `weights.bin`."""
        (folder / WEIGHTS_FILE).write_bytes(bytes(self._bytes))


def externalise(model: onnx.ModelProto, store: WeightStore) -> onnx.ModelProto:
    """Moves the graph's larger float32 tensors into the store; as float16 where that is exact."""
    casts = []
    for tensor in model.graph.initializer:
        values = numpy_helper.to_array(tensor)
        if values.dtype != np.float32 or values.size < SMALL:
            continue
        half = values.astype(np.float16)
        exact = np.array_equal(half.astype(np.float32), values)
        name = tensor.name
        if exact:
            tensor.name = f"{name}.f16"
            casts.append(helper.make_node("Cast", [tensor.name], [name], to=TensorProto.FLOAT))
        tensor.data_type = TensorProto.FLOAT16 if exact else TensorProto.FLOAT
        offset, length = store.add((half if exact else values).tobytes())
        tensor.ClearField("raw_data")
        tensor.ClearField("float_data")
        tensor.data_location = TensorProto.EXTERNAL
        del tensor.external_data[:]
        for key, value in (("location", WEIGHTS_FILE), ("offset", offset), ("length", length)):
            tensor.external_data.add(key=key, value=str(value))
    nodes = list(model.graph.node)
    del model.graph.node[:]
    model.graph.node.extend(casts + nodes)
    return model


def without_scores(model: onnx.ModelProto) -> onnx.ModelProto:
    """The same step graph for one candidate: it is chosen, whatever it costs.

    The operations that only compute its terms are left out, which saves a twelfth of a step. The
    other outputs are the same, bit for bit.
    """
    made = onnx.ModelProto()
    made.CopyFrom(model)
    nodes = [
        helper.make_node("Shape", ["policy"], ["rows"]),
        helper.make_node("Sub", ["rows", "rows"], ["zero"]),
        helper.make_node("Expand", ["zero", "rows"], ["choice"]),
        *(node for node in model.graph.node if "choice" not in node.output),
    ]
    outputs = [each for each in model.graph.output if each.name not in LEFT_OUT]
    wanted, kept = {each.name for each in outputs}, []
    for node in reversed(nodes):  # a node comes after its inputs
        if not wanted.isdisjoint(node.output):
            wanted.update(node.input)
            kept.append(node)
    tensors = [each for each in model.graph.initializer if each.name in wanted]
    del made.graph.node[:], made.graph.output[:], made.graph.initializer[:]
    del made.graph.value_info[:]
    made.graph.node.extend(reversed(kept))
    made.graph.output.extend(outputs)
    made.graph.initializer.extend(tensors)
    return made
