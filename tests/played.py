"""glTF as a player shows it, by the standard alone."""

import json
import struct
from typing import Any

import numpy as np

KINDS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
REST = {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}

Array = np.ndarray
Json = dict[str, Any]


def parts(data: bytes) -> tuple[Json, bytes]:
    """Document and binary chunk of a GLB."""
    magic, version, length, size, kind = struct.unpack_from("<4sIIII", data)
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), 0x4E4F534A)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


class Played:
    """A document at each frame of one of its animations."""

    def __init__(self, document: Json, binary: bytes, animation: int = 0) -> None:
        self.document, self.binary = document, binary
        self.channels: dict[tuple[int, str], Array] = {}
        self.frames = 1
        if document.get("animations"):
            chosen = document["animations"][animation]
            for channel in chosen["channels"]:
                values = self.values(chosen["samplers"][channel["sampler"]]["output"])
                target = channel["target"]
                self.channels[target["node"], target["path"]] = values
                self.frames = max(self.frames, len(values))
        self.world = self._worlds()

    def values(self, accessor: int) -> Array:
        """[N, C] of an accessor of the binary chunk, tightly packed or strided."""
        found = self.document["accessors"][accessor]
        view = self.document["bufferViews"][found["bufferView"]]
        kind, width = np.dtype(KINDS[found["componentType"]]), WIDTHS[found["type"]]
        start = view.get("byteOffset", 0) + found.get("byteOffset", 0)
        assert start % kind.itemsize == 0
        stride = view.get("byteStride", kind.itemsize * width)
        assert (found["count"] - 1) * stride + kind.itemsize * width <= view["byteLength"]
        rows = np.lib.stride_tricks.as_strided(
            np.frombuffer(self.binary, kind, offset=start, count=1),
            (found["count"], width),
            (stride, kind.itemsize),
        )
        if "min" in found:
            np.testing.assert_allclose(rows.min(0), found["min"], rtol=1e-6)
            np.testing.assert_allclose(rows.max(0), found["max"], rtol=1e-6)
        return rows.astype(float if kind.kind == "f" else int)

    def places(self, nodes: list[int]) -> Array:
        """[F, n, 3] of nodes of the scene."""
        return np.stack([self.world[node][:, :3, 3] for node in nodes], 1)

    def _worlds(self) -> dict[int, Array]:
        """[F, 4, 4] of every node of the scene."""
        nodes, found = self.document["nodes"], {}
        top = np.broadcast_to(np.eye(4), (self.frames, 4, 4))
        scene = self.document["scenes"][self.document.get("scene", 0)]
        waiting = [(number, top) for number in scene["nodes"]]
        for number, above in waiting:
            found[number] = above @ self._local(number, nodes[number])
            waiting += [(child, found[number]) for child in nodes[number].get("children", [])]
        return found

    def _local(self, number: int, node: Json) -> Array:
        if "matrix" in node:
            return np.array(node["matrix"], float).reshape(4, 4).T
        values = {
            path: self.channels.get((number, path), np.array([node.get(path, rest)], float))
            for path, rest in REST.items()
        }
        local = np.broadcast_to(np.eye(4), (self.frames, 4, 4)).copy()
        local[:, :3, :3] = matrices(values["rotation"]) * values["scale"][:, None, :]
        local[:, :3, 3] = values["translation"]
        return local


def matrices(turns: Array) -> Array:
    """[..., 3, 3] of quaternions x, y, z, w."""
    x, y, z, w = np.moveaxis(turns / np.linalg.norm(turns, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(np.broadcast_arrays(*row), -1) for row in rows], -2)
