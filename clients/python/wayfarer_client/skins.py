"""The skins of a glTF document: their bind pose, and the places of their vertices."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from .packed import DRACO, meshopt_of, unpack_primitive, unpack_view
from .quaternions import Array, from_axes
from .rig import Node, Rig

KINDS: Final = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS: Final = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
PLACING: Final = ("POSITION", "JOINTS_0", "WEIGHTS_0")
POSED: Final = 0.01
"""The nodes stand in another pose than the skin's bind pose if a joint is off it, relative to
another joint, by this share of the skeleton's size or this many radians.
"""

Json = dict[str, Any]


@dataclass(frozen=True)
class Skins:
    """The document and the binary chunk of a GLB; the nodes of its scene as a rig."""

    document: Json = field(repr=False)
    binary: bytes = field(repr=False)
    rig: Rig = field(repr=False)
    numbers: Sequence[int] = field(repr=False)  # of each node of the rig in the document

    def bound(self) -> Rig:
        """The rig in the bind pose of its skins, whatever frame of an animation the nodes stand in.
        Returns the same rig if its nodes stand in that pose.
        """
        world = worlds(self.rig)
        wanted: dict[int, Array] = {}
        for skin, meshes in self._skins():
            for joint, place in self._bound_joints(skin, meshes, world).items():
                wanted.setdefault(joint, place)
        if not wanted:
            return self.rig
        made: list[Node] = []
        found: list[Array] = []
        for k, node in enumerate(self.rig.nodes):
            above = found[node.parent] if node.parent >= 0 else np.eye(4)
            if k in wanted:
                found.append(wanted[k])
                made.append(_with_transform(node, np.linalg.solve(above, wanted[k])))
            else:
                found.append(above @ local_matrix(node))
                made.append(node)
        return Rig(tuple(made))

    def points(self) -> tuple[Array, Array]:
        """Vertices [V, 3] of the rig as it stands, in the scene's space, and for each the node [V]
        that moves it most. None if the data lies outside of the file, or cannot be unpacked.
        """
        world = worlds(self.rig)
        at = {number: k for k, number in enumerate(self.numbers)}
        places, nodes = [np.zeros((0, 3))], [np.zeros(0, int)]
        for number, k in at.items():
            node = self.document["nodes"][number]
            if "mesh" not in node:
                continue
            skin = self.document["skins"][node["skin"]] if "skin" in node else None
            for primitive in self.document["meshes"][node["mesh"]]["primitives"]:
                attributes = self._attributes(primitive)
                bound = attributes["POSITION"]
                if bound is None:
                    continue
                upright = np.pad(bound, ((0, 0), (0, 1)), constant_values=1.0)
                if skin is None:  # a part that hangs from a bone
                    places.append((upright @ world[k].T)[:, :3])
                    nodes.append(np.full(len(bound), k))
                    continue
                which, weights = attributes["JOINTS_0"], attributes["WEIGHTS_0"]
                inverses = self.inverses(skin)
                if which is None or weights is None or inverses is None:
                    continue
                joints = np.array([at.get(joint, -1) for joint in skin["joints"]])
                moves = np.stack([world[j] for j in joints]) @ inverses
                weights = weights / np.maximum(weights.sum(1, keepdims=True), 1e-9)
                which = which.astype(int)
                moved = np.einsum("vk,vkij,vj->vi", weights, moves[which], upright)
                places.append(moved[:, :3])
                nodes.append(joints[which[np.arange(len(which)), weights.argmax(1)]])
        return np.concatenate(places), np.concatenate(nodes)

    def joints(self) -> list[set[int]]:
        """Joints of each skin of the scene, as nodes of the rig."""
        at = {number: k for k, number in enumerate(self.numbers)}
        return [
            {at[number] for number in skin["joints"] if number in at} for skin, _ in self._skins()
        ]

    def _skins(self) -> list[tuple[Json, list[int]]]:
        """The scene's skins, the largest first, each with the rig's nodes that show it."""
        found: dict[int, list[int]] = {}
        for k, number in enumerate(self.numbers):
            node = self.document["nodes"][number]
            if "skin" in node:
                found.setdefault(node["skin"], []).append(k)
        skins = [(self.document["skins"][number], meshes) for number, meshes in found.items()]
        return sorted(skins, key=lambda skin: -len(skin[0]["joints"]))

    def _bound_joints(self, skin: Json, meshes: list[int], world: list[Array]) -> dict[int, Array]:
        """Joint of the rig → its world matrix in the bind pose; {} if the nodes stand in it."""
        inverses = self.inverses(skin)
        at = {number: k for k, number in enumerate(self.numbers)}
        joints = [at[number] for number in skin["joints"] if number in at]
        if inverses is None or len(joints) != len(skin["joints"]) or len(joints) < 2:
            return {}
        if (np.abs(np.linalg.det(inverses[:, :3, :3])) < 1e-12).any():
            return {}
        bound = np.linalg.inv(inverses)
        shown = np.stack([world[joint] for joint in joints])
        if _alike(shown @ inverses, bound):
            return {}
        top = min(joints, key=lambda joint: len(self.rig.ancestors(joint)))
        above = [*meshes, *self.rig.ancestors(top)]
        spaces = [np.eye(4), *(world[k] for k in above)]
        space = min(spaces, key=lambda matrix: _off(matrix @ bound, shown))
        return dict(zip(joints, space @ bound, strict=True))

    def inverses(self, skin: Json) -> Array | None:
        """Inverse bind matrices [J, 4, 4]."""
        found = self.array(skin.get("inverseBindMatrices"))
        if found is None or len(found) != len(skin["joints"]):
            return None
        return found.reshape(-1, 4, 4).swapaxes(1, 2)

    def _attributes(self, primitive: Json) -> dict[str, Array | None]:
        """Joints and weights of each vertex [V, C]; None if they cannot be read."""
        numbers = primitive["attributes"]
        found = {name: self.array(numbers.get(name)) for name in PLACING}
        packed = primitive.get("extensions", {}).get(DRACO)
        if packed and found["POSITION"] is None:
            view = self.document["bufferViews"][packed["bufferView"]]
            data = self._bytes(view)
            found |= (data and unpack_primitive(primitive, data)) or {}
            position = self.document["accessors"][numbers["POSITION"]]
            if found["POSITION"] is not None and position.get("normalized"):
                found["POSITION"] /= np.iinfo(KINDS[position["componentType"]]).max
        return found

    def array(self, number: int | None) -> Array | None:
        """[N, C] of an accessor; None: its data lies outside of the file, or the library that
        unpacks it is not installed.
        """
        if number is None:
            return None
        found = self.document["accessors"][number]
        if "bufferView" not in found or "sparse" in found:
            return None
        view = self.document["bufferViews"][found["bufferView"]]
        data = self._bytes(view)
        if data is None:
            return None
        packed = meshopt_of(view)
        kind, width = np.dtype(KINDS[found["componentType"]]), WIDTHS[found["type"]]
        start = found.get("byteOffset", 0)
        size = kind.itemsize * width
        stride = (packed or view).get("byteStride", size)
        count = found["count"]
        if not count > 0 or start + (count - 1) * stride + size > len(data):
            raise ValueError(f"accessor {number} reaches beyond its data")
        rows = np.ndarray((count, width), kind, data, start, (stride, kind.itemsize))
        values = rows.astype(float)
        if found.get("normalized"):
            values = np.maximum(values / np.iinfo(kind).max, -1.0)
        return values

    def _bytes(self, view: Json) -> bytes | None:
        """The data of a buffer view, from the binary chunk."""
        packed = meshopt_of(view)
        where = packed or view
        if where["buffer"] != 0 or "uri" in self.document["buffers"][0]:
            return None
        if packed:
            return unpack_view(packed, self.binary)
        start = view.get("byteOffset", 0)
        return self.binary[start : start + view["byteLength"]]


def local_matrix(node: Node) -> Array:
    """The matrix [4, 4] that turns and scales, then moves."""
    x, y, z, w = np.asarray(node.rotation, float) / np.linalg.norm(node.rotation)
    made = np.eye(4)
    made[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    made[:3, :3] *= np.asarray(node.scale, float)
    made[:3, 3] = node.position
    return made


def worlds(rig: Rig) -> list[Array]:
    """[4, 4] of each node."""
    found: list[Array] = []
    for node in rig.nodes:
        above = found[node.parent] if node.parent >= 0 else np.eye(4)
        found.append(above @ local_matrix(node))
    return found


def _with_transform(node: Node, matrix: Array) -> Node:
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    return replace(
        node,
        position=matrix[:3, 3].tolist(),
        rotation=from_axes(matrix[:3, :3] / scale).tolist(),
        scale=scale.tolist(),
    )


def _turns(matrices: Array) -> Array:
    """[N, 3, 3] without scale."""
    return matrices[:, :3, :3] / np.linalg.norm(matrices[:, :3, :3], axis=1, keepdims=True)


def _alike(moves: Array, bound: Array) -> bool:
    """Whether all joints [J, 4, 4] have moved alike since the bind pose."""
    first = np.linalg.inv(moves[0])
    since = first @ moves
    size = float(np.ptp(bound[:, :3, 3], axis=0).max())
    places = (since @ bound)[:, :3, 3] - bound[:, :3, 3]
    turned = np.abs(_turns(since @ bound) - _turns(bound)).max()
    return bool(np.abs(places).max() <= POSED * size and turned <= POSED)


def _off(wanted: Array, shown: Array) -> float:
    """Difference between matrices: the median angle, and the median change of size."""
    sizes = [np.cbrt(np.abs(np.linalg.det(m[:, :3, :3]))) for m in (wanted, shown)]
    traces = np.einsum("jik,jik->j", _turns(wanted), _turns(shown))
    angles = np.arccos(np.clip((traces - 1) / 2, -1, 1))
    return float(np.median(angles) + 10 * np.median(np.abs(np.log(sizes[0] / sizes[1]))))
