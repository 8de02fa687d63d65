"""GLB (glTF 2.0 binary): triangles of the default scene, nodes' transforms applied.

Only data inside the file is read, and only as far as the file has the bytes it claims. Copies of a
mesh count, quantized and packed data (Draco, meshopt) are read, and skins are in the pose of the
nodes. Materials, images and animations are ignored. Extensions that change triangles and are not
read are refused by name.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.meshes.faces import bad, check_count, corners_of
from wayfarer.navigation.meshes.glb_data import GlbData, Json, index
from wayfarer.navigation.meshes.glb_extensions import check_required, draco, instances
from wayfarer.navigation.meshes.transforms import local, placed

_MAX_NODES: Final = 50_000
_MAX_JOINTS: Final = 8
"""Maximum number of sets of four joints per vertex."""
_TRIANGLES, _STRIP, _FAN = 4, 5, 6

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
    """The meshes and nodes of a GLB."""

    def __init__(self, data: bytes) -> None:
        self._data = GlbData(data)
        self.json = self._data.json
        check_required(self.json)
        self._world = self._placed_nodes()
        self._meshes: dict[tuple[int, int], Array] = {}

    def corners(self) -> Array:
        """All triangles of the default scene."""
        pieces, total = [], 0
        for number, matrix in self._world.items():
            node = self.json["nodes"][number]
            if "mesh" not in node:
                continue
            skin = index(node["skin"]) if "skin" in node else -1
            corners = self._mesh(index(node["mesh"]), skin)
            # a skin's joints say where its mesh is, and the node does not
            copies = np.eye(4)[None] if skin >= 0 else matrix @ instances(self._data, node)
            total = check_count(total + len(corners) * len(copies), "triangles")
            pieces.append(placed(corners, copies))
        if not pieces:
            raise bad("no node of the scene has a mesh")
        return np.concatenate(pieces)

    def _placed_nodes(self) -> dict[int, Array]:
        """The world matrix of every node of the scene."""
        nodes = self.json.get("nodes", [])
        check_count(len(nodes), "nodes", _MAX_NODES)
        scenes = self.json.get("scenes", [])
        if scenes:
            tops = scenes[index(self.json.get("scene", 0))].get("nodes", [])
        else:
            below = {index(child) for node in nodes for child in node.get("children", [])}
            tops = [number for number in range(len(nodes)) if number not in below]
            if nodes and not tops:
                raise bad("each node hangs from another one: nodes of glTF form a tree")
        waiting = [(index(node), np.eye(4)) for node in tops]
        found: dict[int, Array] = {}
        while waiting:
            number, parent = waiting.pop()
            if number in found:
                raise bad(f"node {number} has two parents: nodes of glTF form a tree")
            found[number] = parent @ local(nodes[number])
            waiting += [(index(c), found[number]) for c in nodes[number].get("children", [])]
        return found

    def _mesh(self, number: int, skin: int) -> Array:
        """Corners of all the mesh's primitives, without lines and points."""
        if (number, skin) in self._meshes:
            return self._meshes[number, skin]
        pieces, total = [np.empty((0, 3, 3))], 0
        for primitive in self.json["meshes"][number]["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            if mode not in (_TRIANGLES, _STRIP, _FAN):
                continue
            found = draco(self._data, primitive)
            attributes, order = (
                found
                if found is not None
                else (self._attributes(primitive), self._order(primitive))
            )
            vertices = attributes["POSITION"]
            if skin >= 0:
                vertices = self._skinned(attributes, skin)
            total = check_count(total + len(order) // 3, "triangles of a mesh")
            triangles = _triangles(order, mode if found is None else _TRIANGLES)
            pieces.append(corners_of(vertices, triangles))
        self._meshes[number, skin] = np.concatenate(pieces)
        return self._meshes[number, skin]

    def _attributes(self, primitive: Json) -> dict[str, Array]:
        """Positions [V, 3]; joints and weights [V, 4] where there are some."""
        given = {name: index(number) for name, number in primitive["attributes"].items()}
        found = {"POSITION": self._data.numbers(given["POSITION"], ("VEC3",))}
        for k in range(_MAX_JOINTS):
            if f"JOINTS_{k}" not in given:
                break
            for name in (f"JOINTS_{k}", f"WEIGHTS_{k}"):
                found[name] = self._data.numbers(given[name], ("VEC4",))
        return found

    def _order(self, primitive: Json) -> NDArray[np.int64]:
        """Indices of vertices."""
        if "indices" in primitive:
            return self._data.whole(index(primitive["indices"]), ("SCALAR",))[:, 0]
        return np.arange(self._data.count(index(primitive["attributes"]["POSITION"])))

    def _skinned(self, attributes: dict[str, Array], number: int) -> Array:
        """Vertices [V, 3] in the present pose of a skin's joints."""
        skin = self.json["skins"][number]
        joints = np.stack([self._world[index(joint)] for joint in skin["joints"]])
        if "inverseBindMatrices" in skin:
            inverse = self._data.numbers(index(skin["inverseBindMatrices"]), ("MAT4",))
            joints = joints @ inverse[: len(joints)].reshape(-1, 4, 4).swapaxes(1, 2)
        vertices = attributes["POSITION"]
        moved, total = np.zeros_like(vertices), np.zeros((len(vertices), 1))
        for k in range(_MAX_JOINTS):
            if f"JOINTS_{k}" not in attributes:
                break
            for which, weight in zip(
                attributes[f"JOINTS_{k}"].T.astype(int), attributes[f"WEIGHTS_{k}"].T, strict=True
            ):
                matrix = joints[np.where(weight > 0, which, 0)]
                spots = (matrix[:, :3, :3] @ vertices[..., None])[..., 0] + matrix[:, :3, 3]
                moved += weight[:, None] * spots
                total += weight[:, None]
        return np.where(total > 0, moved / np.where(total > 0, total, 1), vertices)


def _triangles(order: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Vertex indices [n] → triangles [T, 3]."""
    if mode == _TRIANGLES:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    first = np.full(len(order) - 2, order[0]) if mode == _FAN else order[:-2]
    triangles = np.stack([first, order[1:-1], order[2:]], -1)
    if mode == _STRIP:
        triangles[1::2] = triangles[1::2, ::-1]
    return triangles
