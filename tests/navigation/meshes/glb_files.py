"""GLB files made by hand."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

LEVELS = Path(__file__).parents[1] / "levels"
"""Cases from levels of others, made by hand."""

TYPES = {
    "int8": 5120,
    "uint8": 5121,
    "int16": 5122,
    "uint16": 5123,
    "uint32": 5125,
    "float32": 5126,
}
WIDTHS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def glb(document: dict[str, Any], blob: bytes = b"", claimed: int | None = None) -> bytes:
    """The file of a document and its binary chunk; it may claim another length than it has."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if blob:
        chunks += struct.pack("<II", len(blob), 0x004E4942) + blob
    total = 12 + len(chunks) if claimed is None else claimed
    return struct.pack("<III", 0x46546C67, 2, total) + chunks


class Packer:
    """Gathers arrays and bytes into one buffer: accessors and views count from 0."""

    def __init__(self) -> None:
        self.blob = b""
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def view(self, data: bytes) -> int:
        self.views.append({"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data)})
        self.blob += data + bytes(-len(data) % 4)
        return len(self.views) - 1

    def accessor(self, values: np.ndarray, **changes: Any) -> int:
        """`changes`: of the accessor's JSON; None removes a key."""
        view = self.view(np.ascontiguousarray(values).tobytes())
        return self.describe(values, bufferView=view, **changes)

    def describe(self, values: np.ndarray, **changes: Any) -> int:
        flat = values.reshape(len(values), -1)
        found = {
            "componentType": TYPES[str(values.dtype)],
            "count": len(values),
            "type": WIDTHS[flat.shape[1]],
            **changes,
        }
        self.accessors.append(found)
        return len(self.accessors) - 1

    def file(self, **document: Any) -> bytes:
        """Has one mesh of accessor 0 at one node, unless the document says otherwise."""
        usual: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.blob)}],
        }
        return glb({**usual, **document}, self.blob)


def grid(side: int, step: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A level square of side x side cells in glTF's axes: vertices [V, 3] and faces [T, 3]."""
    z, x = np.mgrid[: side + 1, : side + 1]
    vertices = np.stack([x * step, 0 * x, z * step], -1).reshape(-1, 3).astype(np.float32)
    a = (z[:-1, :-1] * (side + 1) + x[:-1, :-1]).reshape(-1)
    one, other = [a, a + side + 2, a + 1], [a, a + side + 1, a + side + 2]
    faces = np.concatenate([np.stack(one, 1), np.stack(other, 1)])
    return vertices, faces.astype(np.uint32)
