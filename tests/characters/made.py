"""Characters made by code: boxes on the bones of a person's skeleton, with the peculiarities of
other people's files.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tests.clients.test_character import document_of, glb
from tests.golden.rigs import Body, offsets_of, vocabulary
from wayfarer.characters.bones_by_name import by_names
from wayfarer.characters.rig import Rig
from wayfarer.characters.skins import worlds

Array = np.ndarray
MIXAMO = vocabulary("mixamo")
FEET = ("left_ankle", "right_ankle", "left_foot", "right_foot")


@dataclass
class Shoe:
    """Lengths in metres."""

    heel: float = 0.07  # behind the ankle's joint
    tip: float = 0.09  # before the toes' joint
    sole: float = 0.02  # below the toes' joint


@dataclass
class Made:
    """A character as a GLB; `rig` names its bones so that `bones` finds them."""

    rig: Rig
    bones: dict[str, int]
    shoe: Shoe = field(default_factory=Shoe)
    posed: Callable[[Rig], Rig] = lambda rig: rig
    """The pose in which the nodes stand; the skin is bound to `rig`."""
    owners: dict[str, int] = field(default_factory=dict)
    """Nodes that move a bone's box instead of the bone's own node."""
    parts: tuple[tuple[int, Array], ...] = ()
    """Boxes without skin: the node that they hang from, and where [3]."""

    def data(self) -> bytes:
        corners, joints, faces = self._boxes()
        document = document_of(self.posed(self.rig), shift=0)
        inverses = [np.linalg.inv(matrix).T.astype("<f4") for matrix in worlds(self.rig)]
        weights = np.zeros((len(joints), 4), "<f4")
        weights[:, 0] = 1
        arrays: list[tuple[Array, str, int | None]] = [
            (corners.astype("<f4"), "VEC3", 34962),
            (np.pad(joints[:, None], ((0, 0), (0, 3))).astype("<u2"), "VEC4", 34962),
            (weights, "VEC4", 34962),
            (faces.astype("<u2").reshape(-1, 1), "SCALAR", 34963),
            (np.stack(inverses).reshape(-1, 16), "MAT4", None),
        ]
        binary = b""
        document |= {"bufferViews": [], "accessors": []}
        for k, (values, kind, target) in enumerate(arrays):
            binary += b"\0" * (-len(binary) % 4)
            view = {"buffer": 0, "byteOffset": len(binary), "byteLength": values.nbytes}
            document["bufferViews"].append(view | ({"target": target} if target else {}))
            accessor: dict[str, Any] = {
                "bufferView": k,
                "componentType": {"f": 5126, "u": 5123}[values.dtype.kind],
                "count": len(values),
                "type": kind,
            }
            if k == 0:
                accessor |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
            document["accessors"].append(accessor)
            binary += values.tobytes()
        attributes = {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}
        document["meshes"] = [{"primitives": [{"attributes": attributes, "indices": 3}]}]
        count = len(self.rig.nodes)
        document["skins"] = [{"joints": list(range(count)), "inverseBindMatrices": 4}]
        document["nodes"].append({"name": "skin", "mesh": 0, "skin": 0})
        document["scenes"][0]["nodes"] = [
            *(k for k, node in enumerate(self.rig.nodes) if node.parent < 0),
            count,
        ]
        if self.parts:
            primitive = {"attributes": {"POSITION": 0}, "indices": 3}
            document["meshes"].append({"primitives": [primitive]})
        for node, place in self.parts:
            document["nodes"].append(
                {"name": "part", "mesh": 1, "translation": place.tolist(), "scale": [0.1] * 3}
            )
            document["nodes"][node].setdefault("children", []).append(len(document["nodes"]) - 1)
        document["buffers"] = [{"byteLength": len(binary)}]
        return glb(document, binary + b"\0" * (-len(binary) % 4))

    def _boxes(self) -> tuple[Array, Array, Array]:
        """Corners [V, 3], the node of each [V], and faces [F, 3]: shoes for feet, or cubes."""
        places, joints, faces = [], [], []
        low = min(self.rig.places[self.bones[bone]][1] for bone in FEET if bone in self.bones)
        low -= self.shoe.sole
        for bone, node in self.bones.items():
            if bone == "pelvis":  # it may be the root, on the floor
                continue
            at = self.rig.places[node]
            half = 0.57 * self.shoe.heel
            box = np.array([at - half, at + half])
            if bone.endswith("ankle"):
                box[:, 1] = (low, at[1])
                ahead = 1.4 if bone.replace("ankle", "foot") in self.bones else 2.9
                box[:, 2] = (at[2] - self.shoe.heel, at[2] + ahead * self.shoe.heel)
            if bone.endswith("foot"):
                box[:, 1] = (low, at[1] + half / 2)
                box[:, 2] = (at[2] - half / 2, at[2] + self.shoe.tip)
            corners = np.array(
                [[box[x][0], box[y][1], box[z][2]] for x, y, z in np.ndindex(2, 2, 2)]
            )
            faces.append(len(places) * 8 + FACES)
            places.append(corners)
            joints.append(np.full(8, self.owners.get(bone, node)))
        return np.concatenate(places), np.concatenate(joints), np.concatenate(faces)


FACES = np.array(
    [
        *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
        *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
    ]
)


def person(scale: float = 1.0, gender: str = "female", **changes: Any) -> Made:
    """A person's skeleton with Mixamo's names; `scale`: of all its lengths."""
    body = Body(offsets_of(gender, []), names=MIXAMO, scale=scale)
    shoe = changes.pop("shoe", Shoe(*(scale * np.array([0.07, 0.09, 0.02]))))
    return of(body.rig(), shoe=shoe, **changes)


def of(rig: Rig, **changes: Any) -> Made:
    """A rig with names that identify its bones."""
    return Made(rig, by_names(rig), **changes)


def number(rig: Rig, name: str) -> int:
    """Number of a node."""
    return next(k for k, node in enumerate(rig.nodes) if node.name == name)


def moved(rig: Rig, changes: dict[str, dict[str, Any]]) -> Rig:
    """The rig with other transforms of some nodes, by name."""
    return Rig(tuple(replace(node, **changes.get(node.name, {})) for node in rig.nodes))


def lifted(rig: Rig, height: float, but: tuple[str, ...] = ()) -> Rig:
    """The rig raised by `height`, except for some nodes, by name: as heels lift ankles."""
    places = rig.places + np.array([0, height, 0])
    for name in but:
        places[number(rig, name)] -= [0, height, 0]
    nodes = []
    for k, node in enumerate(rig.nodes):
        above = places[node.parent] if node.parent >= 0 else np.zeros(3)
        nodes.append(replace(node, position=(places[k] - above).tolist()))
    return Rig(tuple(nodes))
