"""GLB (glTF 2.0 binary): triangles of the default scene, nodes' transforms applied.

Only what is inside the file is read, and only where the file has the bytes it claims: external
buffers, compressed or sparse data are refused by name; materials, images, skins and animations are
never looked at.
"""

import json
import struct
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.meshes.faces import bad, check_count, corners_of
from wayfarer.navigation.scene_spec import MAX_TRIANGLES

_MAGIC: Final = 0x46546C67
_JSON, _BIN = 0x4E4F534A, 0x004E4942
_MAX_JSON: Final = 8 * 2**20
_MAX_NODES: Final = 50_000
_INDEX_TYPES: Final = {5121: "<u1", 5123: "<u2", 5125: "<u4"}
_FLOAT: Final = 5126
_TRIANGLES, _STRIP, _FAN = 4, 5, 6

Json = dict[str, Any]
Array = NDArray[np.float64]


def read_glb(data: bytes) -> Array:
    """Corners [T, 3, 3] in glTF's own axes. Raises InvalidArgument."""
    try:
        return _Document(data).corners()
    except InvalidArgument:
        raise
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError) as error:
        # a document of the wrong shape: keys missing, numbers where lists belong
        raise bad(f"the glTF document is malformed ({type(error).__name__}: {error})") from None


class _Document:
    """The JSON and the one binary chunk of a GLB."""

    def __init__(self, data: bytes) -> None:
        if len(data) < 20:
            raise bad("shorter than a GLB header")
        magic, version, length = struct.unpack_from("<III", data)
        if magic != _MAGIC or version != 2:
            raise bad("not a GLB of version 2 (glTF 2.0 binary)")
        if length != len(data):
            raise bad(f"the header says {length:,} bytes, the file has {len(data):,}")
        chunks = _chunks(data)
        if len(chunks.get(_JSON, b"")) > _MAX_JSON:
            raise bad(f"the JSON chunk exceeds {_MAX_JSON:,} bytes")
        try:
            self.json: Json = json.loads(chunks[_JSON])
        except (KeyError, ValueError, RecursionError):
            raise bad("no readable JSON chunk") from None
        self.blob = chunks.get(_BIN, b"")
        required = self.json.get("extensionsRequired", [])
        if required and set(required) - {"KHR_materials_unlit", "KHR_texture_transform"}:
            raise bad(f"needs the glTF extensions {required}; export without compression")

    def corners(self) -> Array:
        """All triangles of the default scene."""
        meshes: dict[int, Array] = {}
        pieces, total = [], 0
        for mesh, matrix in self._instances():
            if mesh not in meshes:
                meshes[mesh] = self._mesh(self.json["meshes"][mesh])
            total = check_count(total + len(meshes[mesh]), "triangles")
            placed = meshes[mesh] @ matrix[:3, :3].T + matrix[:3, 3]
            # a mirroring node turns its triangles over
            pieces.append(placed[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else placed)
        if not pieces:
            raise bad("no node of the scene has a mesh")
        return np.concatenate(pieces)

    def _instances(self) -> list[tuple[int, Array]]:
        """(mesh, world matrix) of every node of the scene that has a mesh."""
        nodes = self.json.get("nodes", [])
        check_count(len(nodes), "nodes", _MAX_NODES)
        scenes = self.json.get("scenes", [])
        roots = scenes[_index(self.json.get("scene", 0))]["nodes"] if scenes else range(len(nodes))
        waiting = [(_index(node), np.eye(4)) for node in roots]
        seen, found = set(), list[tuple[int, Array]]()
        while waiting:
            number, parent = waiting.pop()
            if number in seen:
                raise bad(f"node {number} has two parents: nodes of glTF form a tree")
            seen.add(number)
            node = nodes[number]
            matrix = parent @ _local(node)
            if "mesh" in node:
                found.append((_index(node["mesh"]), matrix))
            waiting += [(_index(child), matrix) for child in node.get("children", [])]
        return found

    def _mesh(self, mesh: Json) -> Array:
        """Corners of all the mesh's primitives; lines and points are passed over."""
        pieces, total = [np.empty((0, 3, 3))], 0
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            if mode not in (_TRIANGLES, _STRIP, _FAN):
                continue
            vertices = self._positions(_index(primitive["attributes"]["POSITION"]))
            order = (
                self._indices(_index(primitive["indices"]))
                if "indices" in primitive
                else np.arange(len(vertices))
            )
            total = check_count(total + len(order) // 3, "triangles of a mesh")
            pieces.append(corners_of(vertices, _triangles(order, mode)))
        return np.concatenate(pieces)

    def _positions(self, number: int) -> Array:
        accessor = self.json["accessors"][number]
        if accessor["componentType"] != _FLOAT or accessor["type"] != "VEC3":
            raise bad(f"accessor {number} of positions is not float VEC3")
        return self._values(accessor, number, "<f4", 3).astype(np.float64)

    def _indices(self, number: int) -> NDArray[np.int64]:
        accessor = self.json["accessors"][number]
        if accessor["componentType"] not in _INDEX_TYPES or accessor["type"] != "SCALAR":
            raise bad(f"accessor {number} of indices is not an unsigned SCALAR")
        kind = _INDEX_TYPES[accessor["componentType"]]
        return self._values(accessor, number, kind, 1)[:, 0].astype(np.int64)

    def _values(self, accessor: Json, number: int, kind: str, width: int) -> NDArray[Any]:
        """[count, width] of an accessor, all of it inside the file's own bytes."""
        if "sparse" in accessor or "bufferView" not in accessor:
            raise bad(f"accessor {number} is sparse or has no data; export plain data")
        count = check_count(_index(accessor["count"]), "elements of an accessor", 3 * MAX_TRIANGLES)
        view = self.json["bufferViews"][_index(accessor["bufferView"])]
        buffers = self.json["buffers"]
        if _index(view["buffer"]) != 0 or "uri" in buffers[0]:
            raise bad("data outside of the file is not fetched: pack all into one GLB")
        size = np.dtype(kind).itemsize * width
        stride = _index(view.get("byteStride", size)) or size
        inner = _index(accessor.get("byteOffset", 0))
        start = _index(view.get("byteOffset", 0)) + inner
        used = (count - 1) * stride + size if count else 0
        room = min(_index(view["byteLength"]) - inner, len(self.blob) - start)
        if stride < size or stride > 252 + size or used > room:
            raise bad(f"accessor {number} claims {used:,} bytes, its buffer view holds {room:,}")
        return np.ndarray((count, width), kind, self.blob, start, (stride, np.dtype(kind).itemsize))


def _chunks(data: bytes) -> dict[int, bytes]:
    """The first chunk of each kind."""
    found: dict[int, bytes] = {}
    at = 12
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, at)
        if at + 8 + length > len(data):
            raise bad(f"a chunk claims {length:,} bytes, {len(data) - at - 8:,} are left")
        found.setdefault(kind, data[at + 8 : at + 8 + length])
        at += 8 + length
    return found


def _index(value: Any) -> int:
    """A JSON number that is a count or an index."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise bad(f"{str(value)[:40]!r} is no index")
    return value


def _local(node: Json) -> Array:
    """A node's own transform. [4, 4]"""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = (float(v) for v in node.get("rotation", (0, 0, 0, 1)))
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.array(node.get("scale", (1, 1, 1)), np.float64)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _triangles(order: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Vertex indices [n] → triangles [T, 3]."""
    if mode == _TRIANGLES:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    first = np.full(len(order) - 2, order[0]) if mode == _FAN else order[:-2]
    triangles = np.stack([first, order[1:-1], order[2:]], -1)
    if mode == _STRIP:
        triangles[1::2] = triangles[1::2, ::-1]
    return triangles
