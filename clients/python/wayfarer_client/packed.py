"""Data packed in a GLB by meshopt or Draco; both need `wayfarer-client[compressed]`.

Without their libraries, such data cannot be read: the character then has feet of the usual shape.
"""

from importlib import import_module
from types import ModuleType
from typing import Any, Final

import numpy as np

from .quaternions import Array

MESHOPT: Final = ("EXT_meshopt_compression", "KHR_meshopt_compression")
DRACO: Final = "KHR_draco_mesh_compression"
MAX_BYTES: Final = 128 * 2**20
"""Sizes of a buffer view when it is unpacked."""

Json = dict[str, Any]


def meshopt_of(view: Json) -> Json | None:
    """The extension that describes how a buffer view was packed; None: it was not."""
    extensions = view.get("extensions", {})
    return next((extensions[name] for name in MESHOPT if name in extensions), None)


def unpack_view(packed: Json, binary: bytes) -> bytes | None:
    """The bytes of a buffer view; None without the library. Raises ValueError."""
    library = _library("meshopt")
    count, stride = packed["count"], packed["byteStride"]
    if library is None:
        return None
    if not 0 <= count * stride <= MAX_BYTES:
        raise ValueError(f"a buffer view of {count * stride:,} bytes, unpacked")
    start = packed.get("byteOffset", 0)
    source = binary[start : start + packed["byteLength"]]
    found = library.decode_gltf_buffer(source, count, stride, packed["mode"], packed.get("filter"))
    return bytes(found.tobytes())


def unpack_primitive(primitive: Json, data: bytes) -> dict[str, Array] | None:
    """Attributes of a primitive by name [V, C]; None without the library. Raises ValueError."""
    library = _library("DracoPy")
    if library is None:
        return None
    try:
        mesh = library.decode(data)
    except (library.FileTypeException, RuntimeError) as error:
        raise ValueError(str(error)) from None
    by_id = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
    names = primitive["extensions"][DRACO]["attributes"]
    found = {name: np.asarray(by_id[number]) for name, number in names.items() if number in by_id}
    return {
        # weights may be whole numbers; their sum is made 1 later on
        name: values.reshape(len(values), -1).astype(float)
        for name, values in found.items()
    }


def _library(name: str) -> ModuleType | None:
    try:
        return import_module(name)
    except ImportError:
        return None
