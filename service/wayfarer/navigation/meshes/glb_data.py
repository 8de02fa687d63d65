"""The bytes of a GLB: its JSON, its buffers, and the numbers that accessors name."""

import base64
import binascii
import json
import struct
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.meshes.faces import bad, check_count
from wayfarer.navigation.scene_spec import MAX_TRIANGLES

Json = dict[str, Any]

_MAGIC: Final = 0x46546C67
_JSON, _BIN = 0x4E4F534A, 0x004E4942
_MAX_JSON: Final = 8 * 2**20
_TYPES: Final = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS: Final = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_MOST: Final = 3 * MAX_TRIANGLES
_MOST_UNPACKED: Final = 128 * 2**20
"""Bytes that the buffer views of a file may have, unpacked."""
MESHOPT: Final = ("EXT_meshopt_compression", "KHR_meshopt_compression")


class GlbData:
    """The JSON of a GLB, and typed access to its buffers."""

    def __init__(self, data: bytes) -> None:
        """Raises InvalidArgument."""
        if data[:64].lstrip()[:1] == b"{":
            raise bad("a .gltf keeps its data in files beside it: export as .glb, one binary file")
        if len(data) < 20:
            raise bad("shorter than a GLB header")
        magic, version, length = struct.unpack_from("<III", data)
        if magic != _MAGIC or version != 2:
            raise bad("not a GLB of version 2 (glTF 2.0 binary)")
        if length != len(data):
            raise bad(f"the header says {length:,} bytes, the file has {len(data):,}")
        chunks = _chunks(data)
        if len(chunks.get(_JSON, b"")) > _MAX_JSON:
            raise bad(
                f"the JSON chunk has {len(chunks[_JSON]):,} bytes, at most {_MAX_JSON:,}; large "
                "buffers belong into the binary chunk"
            )
        try:
            self.json: Json = json.loads(chunks[_JSON])
        except (KeyError, ValueError, RecursionError):
            raise bad("no readable JSON chunk") from None
        self._chunk = chunks.get(_BIN)
        self._buffers: dict[int, bytes] = {}
        self._unpacked: dict[int, bytes] = {}

    def numbers(self, number: int, kinds: tuple[str, ...]) -> NDArray[np.float64]:
        """Values [count, width] of an accessor of one of these types; normalized ones as the
        numbers that they represent.
        """
        accessor = self.json["accessors"][number]
        values = self.raw(number, kinds)
        if values.dtype.kind == "f" or not accessor.get("normalized", False):
            return values.astype(np.float64)
        return np.maximum(values / np.iinfo(values.dtype).max, -1.0)

    def whole(self, number: int, kinds: tuple[str, ...]) -> NDArray[np.int64]:
        """Values of an accessor of unsigned whole numbers."""
        values = self.raw(number, kinds)
        if values.dtype.kind != "u":
            raise bad(f"accessor {number} holds no unsigned whole numbers")
        return values.astype(np.int64)

    def count(self, number: int) -> int:
        """How many elements an accessor has."""
        count = index(self.json["accessors"][number]["count"])
        return check_count(count, f"elements of accessor {number}", _MOST)

    def raw(self, number: int, kinds: tuple[str, ...]) -> NDArray[Any]:
        """Values [count, width] as they are stored, all of them inside the file's own bytes."""
        accessor = self.json["accessors"][number]
        kind, width = self.layout(number, kinds)
        if "sparse" in accessor or "bufferView" not in accessor:
            raise bad(f"accessor {number} is sparse or has no data; export plain data")
        count = self.count(number)
        view, buffer = self._view(index(accessor["bufferView"]))
        size = np.dtype(kind).itemsize * width
        stride = index(view.get("byteStride", size)) or size
        inner = index(accessor.get("byteOffset", 0))
        start = index(view.get("byteOffset", 0)) + inner
        used = (count - 1) * stride + size if count else 0
        room = min(index(view["byteLength"]) - inner, len(buffer) - start)
        if stride < size or stride > 252 + size or used > room:
            raise bad(f"accessor {number} claims {used:,} bytes, its buffer view holds {room:,}")
        return np.ndarray((count, width), kind, buffer, start, (stride, np.dtype(kind).itemsize))

    def layout(self, number: int, kinds: tuple[str, ...]) -> tuple[str, int]:
        """Type of a number, and numbers per element."""
        accessor = self.json["accessors"][number]
        if accessor["type"] not in kinds or accessor["componentType"] not in _TYPES:
            raise bad(f"accessor {number} is not of the type {' or '.join(kinds)}")
        return _TYPES[accessor["componentType"]], _WIDTHS[accessor["type"]]

    def bytes_of(self, number: int) -> bytes:
        """The data of a buffer view."""
        view, buffer = self._view(number)
        start, length = index(view.get("byteOffset", 0)), index(view["byteLength"])
        if start + length > len(buffer):
            raise bad(f"buffer view {number} claims {length:,} bytes beyond its buffer's end")
        return buffer[start : start + length]

    def _view(self, number: int) -> tuple[Json, bytes]:
        """A buffer view and its buffer; data packed by meshopt have their own buffer."""
        view = self.json["bufferViews"][number]
        packed = next(
            (view["extensions"][n] for n in MESHOPT if n in view.get("extensions", {})), None
        )
        if packed is None or self._has_bytes(index(view["buffer"])):
            return view, self._buffer(index(view["buffer"]))
        if number not in self._unpacked:
            self._unpacked[number] = self._unpack(number, packed)
        plain = {"byteLength": len(self._unpacked[number])}
        if packed["mode"] == "ATTRIBUTES":
            plain["byteStride"] = packed["byteStride"]
        return plain, self._unpacked[number]

    def _unpack(self, number: int, packed: Json) -> bytes:
        """Raises InvalidArgument, before anything is unpacked if it would be too large."""
        count, stride = index(packed["count"]), index(packed["byteStride"])
        size = count * stride
        if size + sum(map(len, self._unpacked.values())) > _MOST_UNPACKED:
            raise bad(
                f"buffer view {number} has {size:,} bytes, unpacked; all those of a file may have "
                f"{_MOST_UNPACKED:,}"
            )
        start, length = index(packed.get("byteOffset", 0)), index(packed["byteLength"])
        source = self._buffer(index(packed["buffer"]))[start : start + length]
        if len(source) < length:
            raise bad(f"buffer view {number} claims {length:,} bytes beyond its buffer's end")
        import meshopt  # for the files that need it

        try:
            found = meshopt.decode_gltf_buffer(
                source, count, stride, packed["mode"], packed.get("filter")
            )
        except ValueError as error:
            raise bad(f"buffer view {number} cannot be unpacked ({str(error)[:80]})") from None
        return found.tobytes()

    def _has_bytes(self, number: int) -> bool:
        """Whether the file has the buffer, which is optional if all of it is packed."""
        return "uri" in self.json["buffers"][number] or (number == 0 and self._chunk is not None)

    def _buffer(self, number: int) -> bytes:
        if number not in self._buffers:
            self._buffers[number] = self._read(number)
        return self._buffers[number]

    def _read(self, number: int) -> bytes:
        buffer = self.json["buffers"][number]
        uri = buffer.get("uri")
        if uri is None:
            if number or self._chunk is None:
                raise bad(f"buffer {number} has no bytes in this file")
            return self._chunk
        head, comma, text = str(uri).partition(",")
        if not head.startswith("data:"):
            raise bad(
                f"buffer {number} is {str(uri)[:40]!r}, a file beside this one, which is not "
                "fetched: pack all into one GLB"
            )
        if not comma or not head.endswith(";base64"):
            raise bad(f"buffer {number} is a data URI that is not in base64")
        try:
            return base64.b64decode(text, validate=True)
        except (binascii.Error, ValueError):
            raise bad(f"buffer {number} is a data URI with broken base64") from None


def index(value: Any) -> int:
    """A JSON number that is a count or an index."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise bad(f"{str(value)[:40]!r} is no index")
    return value


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
