"""Characters that others made, as files: MakeHuman's rigs get a skin of one box a bone."""

import json
from pathlib import Path

import numpy as np
import pygltflib
from pygltflib import Accessor, Attributes, BufferView, Node, Primitive

from tests.golden.rules import FOLDER

MANNEQUIN = Path(__file__).with_name("mannequin.glb")
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (-1, 1) for z in (-1, 1)], float)
FACES = np.array(
    [
        *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
        *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
    ]
)
HALF = float(np.sqrt(0.5))
"""Half the width of a box is this share of its length, up to `WIDEST` metres."""
WIDEST = 0.05
SOLE = 0.01
"""Metres from the lowest joint to the floor."""


def names_of(rig: str) -> list[str]:
    return [name for name, *_ in _bones(rig)]


def _bones(rig: str) -> list[tuple[str, int, list[float], list[float]]]:
    return json.loads((FOLDER / "foreign_rigs.json").read_text())["rigs"][rig]


def makehuman(rig: str, rename: dict[str, str] | None = None, most: int | None = None) -> bytes:
    """A rig of tests/golden/foreign_rigs.json as a GLB: Z up, below a node that turns it.

    `rename`: other names for bones. `most`: only this many bones, the first ones.
    """
    bones = _bones(rig)[:most]
    heads = np.array([head for _, _, head, _ in bones])
    tails = np.array([tail for *_, tail in bones])
    floor = min(heads[:, 2].min(), tails[:, 2].min()) - SOLE
    places, joints, corners = [], [], []
    for k, (head, tail) in enumerate(zip(heads, tails, strict=True)):
        along = tail - head
        length = max(float(np.linalg.norm(along)), 1e-3)
        side = np.cross(along, (0, 0, 1) if abs(along[2]) < 0.9 * length else (1, 0, 0))
        side /= np.linalg.norm(side)
        other = np.cross(along / length, side)
        wide = min(0.2 * length, WIDEST)
        places.append(head + CORNERS @ np.stack([along, wide * side, wide * other]))
        if any(word in bones[k][0].lower() for word in ("foot", "toe")):  # soles are flat
            low = np.argsort(places[-1][:, 2])[:4]
            places[-1][low, 2] = floor
        joints.append(np.full(8, k))
        corners.append(FACES + 8 * k)
    parts = {
        "POSITION": np.concatenate(places).astype("<f4"),
        "JOINTS_0": np.pad(np.concatenate(joints)[:, None], ((0, 0), (0, 3))).astype("<u2"),
        "WEIGHTS_0": np.tile(np.array([1, 0, 0, 0], "<f4"), (8 * len(bones), 1)),
    }
    index = np.concatenate(corners).astype("<u4")
    inverse = np.tile(np.eye(4, dtype="<f4"), (len(bones), 1, 1))
    inverse[:, 3, :3] = -heads  # columns first
    arrays = [*parts.values(), index, inverse]
    glb = pygltflib.GLTF2(asset=pygltflib.Asset(version="2.0"), scene=0)
    blob = b""
    for array in arrays:
        glb.bufferViews.append(BufferView(buffer=0, byteOffset=len(blob), byteLength=array.nbytes))
        blob += array.tobytes()
    sizes = [8 * len(bones)] * 3 + [index.size, len(bones)]
    kinds = [(5126, "VEC3"), (5123, "VEC4"), (5126, "VEC4"), (5125, "SCALAR"), (5126, "MAT4")]
    for view, (size, (number, kind)) in enumerate(zip(sizes, kinds, strict=True)):
        glb.accessors.append(Accessor(bufferView=view, componentType=number, count=size, type=kind))
    low, high = parts["POSITION"].min(0), parts["POSITION"].max(0)
    glb.accessors[0].min, glb.accessors[0].max = low.tolist(), high.tolist()
    glb.buffers.append(pygltflib.Buffer(byteLength=len(blob)))
    attributes = Attributes(POSITION=0, JOINTS_0=1, WEIGHTS_0=2)
    glb.meshes.append(pygltflib.Mesh(primitives=[Primitive(attributes=attributes, indices=3)]))
    for k, (name, parent, *_) in enumerate(bones):
        offset = heads[k] - (heads[parent] if parent >= 0 else 0)
        children = [n for n, (_, above, *_) in enumerate(bones) if above == k]
        label = (rename or {}).get(name, name)
        glb.nodes.append(Node(name=label, translation=offset.tolist(), children=children))
    tops = [k for k, (_, parent, *_) in enumerate(bones) if parent < 0]
    skin = len(bones)
    glb.nodes.append(Node(name="body", mesh=0, skin=0))
    turn = [-HALF, 0.0, 0.0, HALF]
    rise = [0.0, -float(low[2]), 0.0]
    glb.nodes.append(Node(name="Armature", rotation=turn, translation=rise, children=[*tops, skin]))
    glb.skins.append(pygltflib.Skin(joints=list(range(len(bones))), inverseBindMatrices=4))
    glb.scenes.append(pygltflib.Scene(nodes=[skin + 1]))
    glb.set_binary_blob(blob)
    return b"".join(glb.save_to_bytes())
