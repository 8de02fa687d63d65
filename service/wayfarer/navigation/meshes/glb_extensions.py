"""glTF's extensions that change triangles."""

import re
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.meshes.faces import bad, check_count
from wayfarer.navigation.meshes.glb_data import MESHOPT, GlbData, index
from wayfarer.navigation.meshes.transforms import composed
from wayfarer.navigation.scene_spec import MAX_TRIANGLES

DRACO: Final = "KHR_draco_mesh_compression"
INSTANCES: Final = "EXT_mesh_gpu_instancing"
READ: Final = frozenset({DRACO, INSTANCES, *MESHOPT, "KHR_mesh_quantization"})

_LOOKS: Final = re.compile(
    r"material|texture|image|light|variant|camera|environment|audio|animation|xmp|metadata|feature"
    r"|outline|visibility|interactivity|selectab|hover|physics|collider|vrm|lod",
    re.IGNORECASE,
)
"""Extensions of these names concern the look, sound or motion of a level, and no triangle."""


def check_required(document: Mapping[str, Any]) -> None:
    """Raises InvalidArgument if triangles need an unknown extension."""
    for name in map(str, document.get("extensionsRequired", [])):
        if name not in READ and not _LOOKS.search(name):
            raise bad(
                f"needs the glTF extension {name[:64]}, which is not read: export without it "
                f"(read: {', '.join(sorted(READ))})"
            )


def instances(data: GlbData, node: Mapping[str, Any]) -> NDArray[np.float64]:
    """Transforms of the copies of a node's mesh, in the node's own axes. [copies, 4, 4]"""
    attributes = node.get("extensions", {}).get(INSTANCES, {}).get("attributes")
    if attributes is None:
        return np.eye(4)[None]
    usual = {"TRANSLATION": (0, 0, 0), "ROTATION": (0, 0, 0, 1), "SCALE": (1, 1, 1)}
    given = {name: index(attributes[name]) for name in usual if name in attributes}
    counts = {data.count(number) for number in given.values()}
    if len(counts) != 1:
        raise bad(f"{INSTANCES}: its accessors have {sorted(counts)} elements, and not one number")
    count = check_count(counts.pop(), "instances of a node", MAX_TRIANGLES)
    found = [
        data.numbers(given[name], ("VEC4" if name == "ROTATION" else "VEC3",))
        if name in given
        else np.tile(np.array(values, np.float64), (count, 1))
        for name, values in usual.items()
    ]
    return composed(*found)


def draco(
    data: GlbData, primitive: Mapping[str, Any]
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int64]] | None:
    """Attributes by name, and the triangles' vertices in a row, of a primitive packed by Draco.
    None: the file has them unpacked.

    The limits of the file also hold for the result.
    """
    packed = primitive.get("extensions", {}).get(DRACO)
    position = index(primitive["attributes"]["POSITION"])
    if packed is None or "bufferView" in data.json["accessors"][position]:
        return None
    # a library of some megabytes, for the files that need it
    import DracoPy

    data.count(position)
    try:
        mesh = DracoPy.decode(data.bytes_of(index(packed["bufferView"])))
    except (DracoPy.FileTypeException, ValueError, RuntimeError) as error:
        raise bad(f"{DRACO}: a primitive cannot be unpacked ({str(error)[:80]})") from None
    faces = getattr(mesh, "faces", None)
    if faces is None:
        raise bad(f"{DRACO}: a primitive holds points and no triangles")
    check_count(len(faces), "triangles of a mesh, unpacked,")
    check_count(len(mesh.points), "vertices of a mesh, unpacked,", 3 * MAX_TRIANGLES)
    by_id = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
    found = {
        name: _meant(data, index(primitive["attributes"][name]), np.asarray(by_id[number]))
        for name, number in packed["attributes"].items()
        if name in primitive["attributes"] and number in by_id
    }
    if "POSITION" not in found:
        raise bad(f"{DRACO}: a primitive has no positions")
    return found, np.asarray(faces, np.int64).reshape(-1)


def _meant(data: GlbData, number: int, values: NDArray[Any]) -> NDArray[np.float64]:
    """Values of an accessor, which may be normalized."""
    accessor = data.json["accessors"][number]
    if values.dtype.kind == "f" or not accessor.get("normalized", False):
        return values.astype(np.float64)
    return np.maximum(values / np.iinfo(values.dtype).max, -1.0)
