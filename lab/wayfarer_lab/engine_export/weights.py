"""Weights that the two graphs of an export for pages share.

`halves.bin` holds them as float16, which is exact: they were rounded before training's export. The
low bytes of all values come first, then the high bytes, which gzip packs to 86 instead of 92 %. The
graphs read them as float32 from `weights.f32`, which nobody downloads: the page makes it of
halves.bin, value by value. A graph that cast them itself would have to be optimised when it is
opened, which takes a page a third longer.
"""

import hashlib
from pathlib import Path
from typing import Final

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, numpy_helper

HALVES_FILE: Final = "halves.bin"
FLOATS_FILE: Final = "weights.f32"
SMALL: Final = 256
"""Tensors of fewer elements stay inside their graph."""
ALIGNMENT: Final = 16
"""Elements: 64 bytes of float32."""


class SharedWeights:
    """Collects tensors by content."""

    def __init__(self) -> None:
        self._parts: list[NDArray[np.float16]] = []
        self._size = 0
        self._places: dict[str, int] = {}

    def take(self, graph: onnx.ModelProto) -> None:
        """Moves the graph's larger tensors that float16 holds exactly out of it, in place."""
        for tensor in graph.graph.initializer:
            values = numpy_helper.to_array(tensor)
            if values.dtype != np.float32 or values.size < SMALL:
                continue
            half = values.astype(np.float16)
            if not np.array_equal(half.astype(np.float32), values):
                continue
            place = {"location": FLOATS_FILE, "offset": 4 * self._add(half.ravel())}
            tensor.ClearField("raw_data")
            tensor.ClearField("float_data")
            tensor.data_location = TensorProto.EXTERNAL
            for key, value in {**place, "length": 4 * values.size}.items():
                tensor.external_data.add(key=key, value=str(value))

    def write(self, folder: Path) -> None:
        """Writes both files."""
        halves = np.concatenate(self._parts)
        pairs = halves.astype("<f2").view(np.uint8).reshape(-1, 2)
        (folder / HALVES_FILE).write_bytes(pairs.T.tobytes())
        (folder / FLOATS_FILE).write_bytes(halves.astype("<f4").tobytes())

    def _add(self, values: NDArray[np.float16]) -> int:
        """Its first element's number in the file; the same values are kept once."""
        key = hashlib.sha256(values.tobytes()).hexdigest()
        if key not in self._places:
            self._places[key] = self._size
            padded = np.pad(values, (0, -len(values) % ALIGNMENT))
            self._parts.append(padded)
            self._size += len(padded)
        return self._places[key]
