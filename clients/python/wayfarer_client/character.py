"""A user's own character in a GLB or VRM file, with an agent's motion put into it.

The file gains one animation, before its own; nothing else changes. The server also uses this module
and those that it imports (service/wayfarer/characters), so their imports are relative.
"""

import json
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from .bone_map import BoneMap, map_bones
from .errors import InvalidArgument
from .joints import character_joints
from .quaternions import IDENTITY, Array, from_axes, inverse, multiply, rotate
from .retarget import CharacterPose, Retarget
from .rig import Node, Rig
from .root import SmoothRoot
from .skins import Skins
from .soles import Soles, measure_soles

MAX_NODES: Final = 20_000
MAX_FRAMES: Final = 120_000
FLOAT: Final = 5126
TRANSFORM: Final = ("translation", "rotation", "scale")
JSON_CHUNK, BIN_CHUNK = 0x4E4F534A, 0x004E4942

Json = dict[str, Any]


@dataclass(frozen=True)
class Character:
    """The document and the binary chunk of a GLB; the nodes of its scene as a rig."""

    document: Json = field(repr=False)
    binary: bytes = field(repr=False)
    rig: Rig = field(repr=False)  # in the pose that its skins were bound in
    bones: BoneMap
    numbers: tuple[int, ...] = field(repr=False)  # of each node of the rig in the document
    soles: Soles | None = field(repr=False)  # None: its mesh cannot be read, or has no feet

    @classmethod
    def read(
        cls, file: str | Path | bytes, correct: Mapping[str, str | None] | None = None
    ) -> "Character":
        """A GLB, VRM 0 or VRM 1; `correct`: as for `map_bones`.

        Raises InvalidArgument for other files, and for rigs without legs.
        """
        data = file if isinstance(file, bytes) else Path(file).read_bytes()
        document, binary = _chunks(data)
        try:
            rig, numbers = _rig(document)
            humanoid = _humanoid(document, numbers)
            skins = Skins(document, binary, rig, numbers)
            rig = skins.bound()
            points = replace(skins, rig=rig).points()
        except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
            raise InvalidArgument(f"its glTF document is damaged: {error!r}") from None
        bones = map_bones(rig, humanoid, correct=correct)
        return cls(document, binary, rig, bones, numbers, measure_soles(bones, *points))

    def corrected(self, changes: Mapping[str, str | None]) -> "Character":
        """The character with other nodes for some bones; see `BoneMap.corrected`."""
        bones = self.bones.corrected(changes)
        points = Skins(self.document, self.binary, self.rig, self.numbers).points()
        return replace(self, bones=bones, soles=measure_soles(bones, *points))

    def joints(self) -> tuple[dict[str, Array], float | None]:
        """Joints [3] at rest by bone, upright in the glTF basis, and the height of the floor. A
        body of its proportions is made from these.
        """
        return character_joints(self.bones, floor=self.soles.floor if self.soles else None)

    def animate(
        self,
        hips: Array,
        rotations: Array,
        rest_offsets: Array,
        fps: float = 40.0,
        title: str = "motion",
        ground: float | None = None,
    ) -> bytes:
        """The file with the motion of an agent, in the glTF basis: hips [N, 3], rotations
        [N, ≥ 22, 4], rest_offsets [≥ 22, 3]. `ground`: its height; none: under the lower sole.

        Raises InvalidArgument when there are no frames, or too many.
        """
        count = len(hips)
        if not 1 <= count <= MAX_FRAMES or len(rotations) != count:
            raise InvalidArgument(f"{count} frames; allowed are 1 to {MAX_FRAMES:,}")
        retarget = Retarget(self.bones, rest_offsets, soles=self.soles)
        carrier = Carrier.of(self, retarget)
        turns = {node: np.empty((count, 4)) for node in retarget.nodes.values()}
        places = {retarget.nodes[bone]: np.empty((count, 3)) for bone in retarget.loose}
        if carrier:
            turns[carrier.node], places[carrier.node] = np.empty((count, 4)), np.empty((count, 3))
        for frame in range(count):
            pose = retarget.pose(hips[frame], rotations[frame], ground)
            local, moved = pose.local, pose.moved
            if carrier:
                root = carrier.follow(frame / fps, pose, hips[frame], rotations[frame][0])
                turns[carrier.node][frame], places[carrier.node][frame] = root
                local, moved = carrier.relative(pose)
            for bone, turn in local.items():
                turns[retarget.nodes[bone]][frame] = turn
            for bone, place in moved.items():
                places[retarget.nodes[bone]][frame] = place
        document: Json = json.loads(json.dumps(self.document))  # parts of it are changed below
        file = _Growing(document, self.binary)
        times = file.add((np.arange(count) / fps)[:, None])
        samplers: list[Json] = []
        channels: list[Json] = []

        def add(node: int, path: str, values: Array, at: int = times) -> None:
            samplers.append({"input": at, "output": file.add(values)})
            target = {"node": self.numbers[node], "path": path}
            channels.append({"sampler": len(samplers) - 1, "target": target})

        for node, values in places.items():
            add(node, "translation", values)
        for node, values in turns.items():
            add(node, "rotation", _continuous(values))
        still = [  # nodes that stand in the frame of another animation
            (node, path, value)
            for node, path, value in self._at_rest()
            if node not in {"translation": places, "rotation": turns}.get(path, {})
        ]
        start = file.add(np.zeros((1, 1))) if still else times
        for node, path, value in still:
            add(node, path, value[None], start)
        for channel in channels:  # an animated node has no matrix
            _split_matrix(document["nodes"][channel["target"]["node"]])
        animation = {"name": title, "channels": channels, "samplers": samplers}
        document["animations"] = [animation, *document.get("animations", [])]
        return file.to_bytes()

    def _at_rest(self) -> Iterator[tuple[int, str, Array]]:
        """Node of the rig, path and value wherever its rest differs from the document."""
        for k, (number, node) in enumerate(zip(self.numbers, self.rig.nodes, strict=True)):
            found = _transform(self.document["nodes"][number])
            rest = (node.position, node.rotation, node.scale)
            for path, own, value in zip(TRANSFORM, found, rest, strict=True):
                if np.abs(np.subtract(own, value)).max() > 1e-9:
                    yield k, path, np.asarray(value, float)


@dataclass
class Carrier:
    """The node above the hips that travels along, with whatever else hangs from it."""

    node: int  # of the rig
    rig: Rig = field(repr=False)
    retarget: Retarget = field(repr=False)
    root: SmoothRoot = field(repr=False)
    _turn: Array = field(default_factory=lambda: IDENTITY, repr=False)
    """The turn since rest of what hangs from it, and its new place, in the world."""
    _place: Array = field(default_factory=lambda: np.zeros(3), repr=False)

    @classmethod
    def of(cls, character: Character, retarget: Retarget) -> "Carrier | None":
        """The carrier; None when the nodes above the hips carry no other node."""
        rig, bones = character.rig, set(retarget.nodes.values())
        skins = Skins(character.document, character.binary, rig, character.numbers)
        joints = skins.joints()
        line = [retarget.nodes[0], *rig.ancestors(retarget.nodes[0])]
        highest = max(k for k, node in enumerate(line) if k == 0 or any(node in s for s in joints))
        own = set(rig.subtree(line[0]))
        held = {
            node
            for node in skins.points()[1].tolist()
            if bones.isdisjoint((node, *rig.ancestors(node)))
        }
        for node in reversed(line[1 : highest + 2]):
            below = set(rig.subtree(node))
            if any(skin & below and not skin & own for skin in joints):
                continue  # the skeleton of another character hangs there, too
            return cls(node, rig, retarget, SmoothRoot(retarget.basis)) if held & below else None
        return None

    def follow(
        self, time: float, pose: CharacterPose, hips: Array, turn: Array
    ) -> tuple[Array, Array]:
        """Its rotation [4] and place [3] relative to its parent, at a frame of the agent."""
        basis, retarget = self.retarget.basis, self.retarget
        point, heading = self.root.update(time, hips, turn, pose.ground)
        about = np.array([*(np.sin(heading / 2) * basis.up), np.cos(heading / 2)])
        self._turn = multiply(about, retarget.turn)
        self._place = point - rotate(about, retarget.origin)
        parent = self.rig.nodes[self.node].parent
        own = multiply(self._turn, self.rig.rotations[self.node])
        place = self._place + rotate(self._turn, self.rig.places[self.node])
        if parent < 0:
            return own, place
        above = inverse(self.rig.rotations[parent])
        away = rotate(above, place - self.rig.places[parent])
        return multiply(above, own), away / self.rig.scales[parent]

    def relative(self, pose: CharacterPose) -> tuple[dict[int, Array], dict[int, Array]]:
        """Local rotations and places of a pose, where bones hang from what was moved."""
        local, moved = dict(pose.local), dict(pose.moved)
        back = inverse(self._turn)
        for bone in self.retarget.loose:
            if self.retarget.hangs[bone] < 0 and self.node in self.rig.ancestors(
                self.retarget.nodes[bone]
            ):
                parent = self.rig.nodes[self.retarget.nodes[bone]].parent
                turn = inverse(multiply(self._turn, self.rig.rotations[parent]))
                place = rotate(back, pose.places[bone] - self._place) - self.rig.places[parent]
                local[bone] = multiply(turn, pose.rotations[bone])
                away = rotate(inverse(self.rig.rotations[parent]), place)
                moved[bone] = away / self.rig.scales[parent]
        return local, moved


class _Growing:
    """Adds arrays to the binary chunk of a document."""

    def __init__(self, document: Json, binary: bytes) -> None:
        self.document = document
        self.binary = bytearray(binary)
        buffers = document.setdefault("buffers", [])
        if not buffers:
            buffers.append({"byteLength": 0})
        elif "uri" in buffers[0]:  # the first of a GLB may lie outside: then it has no chunk
            raise InvalidArgument("its data is in another file; a GLB with its data is needed")
        self.binary = self.binary[: buffers[0]["byteLength"]]
        document.setdefault("bufferViews", [])
        document.setdefault("accessors", [])

    def add(self, values: Array) -> int:
        """Floats [N, C] as an accessor."""
        self.binary.extend(b"\0" * (-len(self.binary) % 4))
        stored = np.ascontiguousarray(values, "<f4")
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": stored.nbytes}
        self.document["bufferViews"].append(view)
        self.binary.extend(stored.tobytes())
        self.document["accessors"].append(
            {
                "bufferView": len(self.document["bufferViews"]) - 1,
                "componentType": FLOAT,
                "count": len(stored),
                "type": {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[stored.shape[1]],
                "min": stored.min(0).tolist(),
                "max": stored.max(0).tolist(),
            }
        )
        return len(self.document["accessors"]) - 1

    def to_bytes(self) -> bytes:
        """The GLB."""
        self.document["buffers"][0]["byteLength"] = len(self.binary)
        text = json.dumps(self.document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.binary) + b"\0" * (-len(self.binary) % 4)
        length = 12 + 8 + len(text) + 8 + len(data)
        return b"".join(
            [
                struct.pack("<4sII", b"glTF", 2, length),
                struct.pack("<II", len(text), JSON_CHUNK),
                text,
                struct.pack("<II", len(data), BIN_CHUNK),
                data,
            ]
        )


def _chunks(data: bytes) -> tuple[Json, bytes]:
    """Document and binary chunk of a GLB. Raises InvalidArgument."""
    if data[:4] != b"glTF":
        raise InvalidArgument("not a GLB: it does not begin with glTF (FBX and .gltf are not read)")
    found: dict[int, bytes] = {}
    at = 12
    while at + 8 <= len(data):
        size, kind = struct.unpack_from("<II", data, at)
        if at + 8 + size > len(data):
            raise InvalidArgument("this GLB ends in the middle of its data")
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    try:
        document = json.loads(found.get(JSON_CHUNK, b""))
    except (ValueError, RecursionError):
        raise InvalidArgument("the document of this GLB is no JSON") from None
    if not isinstance(document, dict):
        raise InvalidArgument("the document of this GLB is no object")
    return document, found.get(BIN_CHUNK, b"")


def _rig(document: Json) -> tuple[Rig, tuple[int, ...]]:
    """The nodes below the scene's, parents first, and their numbers in the document."""
    nodes: Sequence[Json] = document.get("nodes", [])
    if len(nodes) > MAX_NODES:
        raise InvalidArgument(f"{len(nodes)} nodes; allowed are {MAX_NODES:,}")
    scenes = document.get("scenes") or [{"nodes": _tops(nodes)}]
    waiting = [(number, -1) for number in scenes[document.get("scene", 0)].get("nodes", [])]
    numbers: list[int] = []
    made: list[Node] = []
    seen: set[int] = set()
    while waiting:
        number, parent = waiting.pop(0)
        if number in seen or number < 0:
            raise InvalidArgument(f"node {number} hangs from two others, or from itself")
        seen.add(number)
        node = nodes[number]
        position, rotation, scale = _transform(node)
        made.append(Node(str(node.get("name", number)), parent, position, rotation, scale))
        numbers.append(number)
        waiting += [(child, len(made) - 1) for child in node.get("children", [])]
    return Rig(tuple(made)), tuple(numbers)


def _tops(nodes: Sequence[Json]) -> list[int]:
    below = {child for node in nodes for child in node.get("children", [])}
    return [number for number in range(len(nodes)) if number not in below]


def _transform(node: Json) -> tuple[list[float], list[float], list[float]]:
    """Translation, rotation and scale. Raises ValueError when they are no numbers."""
    if "matrix" in node:
        matrix = np.array(node["matrix"], float).reshape(4, 4).T
        scale = np.linalg.norm(matrix[:3, :3], axis=0)
        if np.linalg.det(matrix[:3, :3]) < 0:
            scale[0] = -scale[0]
        return (
            matrix[:3, 3].tolist(),
            from_axes(matrix[:3, :3] / scale).tolist(),
            scale.tolist(),
        )
    found = []
    for key, default in (
        ("translation", [0.0, 0.0, 0.0]),
        ("rotation", [0.0, 0.0, 0.0, 1.0]),
        ("scale", [1.0, 1.0, 1.0]),
    ):
        values = np.array(node.get(key, default), float)
        if values.shape != (len(default),) or not np.isfinite(values).all():
            raise ValueError(f"{key} of node {node.get('name')!r}")
        found.append(values.tolist())
    return found[0], found[1], found[2]


def _split_matrix(node: Json) -> None:
    """The node with properties that can be animated in place of a matrix."""
    if "matrix" in node:
        node["translation"], node["rotation"], node["scale"] = _transform(node)
        del node["matrix"]


def _humanoid(document: Json, numbers: tuple[int, ...]) -> dict[str, int] | None:
    """VRM's bones as nodes of the rig, by VRM 1's names. VRM 0 has the same names for legs, arms
    and spine.
    """
    extensions = document.get("extensions", {})
    if "VRMC_vrm" in extensions:
        table = extensions["VRMC_vrm"]["humanoid"]["humanBones"]
        named = {bone: entry["node"] for bone, entry in table.items()}
    elif "VRM" in extensions:
        named = {
            entry["bone"]: entry["node"] for entry in extensions["VRM"]["humanoid"]["humanBones"]
        }
    else:
        return None
    at = {number: k for k, number in enumerate(numbers)}
    return {bone: at[number] for bone, number in named.items() if number in at}


def _continuous(turns: Array) -> Array:
    """Rotations [N, 4] with neighbours on one half-sphere, so that no player spins."""
    flips = (turns[1:] * turns[:-1]).sum(-1) < 0
    signs = np.where(np.cumsum(flips) % 2 == 1, -1.0, 1.0)
    return np.concatenate([turns[:1], turns[1:] * signs[:, None]])
