"""Characters made of our own body: other axes, poses, names, scales, missing bones; and those that
others made (foreign_rigs.json).
"""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np

from wayfarer.body.library import load_body
from wayfarer.body.skeleton import load_skeleton
from wayfarer.transport.basis import Basis
from wayfarer_client.quaternions import IDENTITY, arc, inverse, multiply, rotate
from wayfarer_client.rig import BONES, PARENTS, Node, Rig

HALF = math.sqrt(0.5)
ABOUT_X = np.array([HALF, 0.0, 0.0, HALF])  # a quarter turn
ABOUT_Y = np.array([0.0, HALF, 0.0, HALF])
ABOUT_Z = np.array([0.0, 0.0, HALF, HALF])
TURN_ROUND = np.array([0.0, 1.0, 0.0, 0.0])
TILTED = {bone: (ABOUT_X, ABOUT_Y, ABOUT_Z)[k % 3] for k, bone in enumerate(BONES)}


def turned(axis: str, degrees: float) -> np.ndarray:
    half = math.radians(degrees) / 2
    return np.array([*(math.sin(half) * np.eye(3)["xyz".index(axis)]), math.cos(half)])


@dataclass
class Body:
    """A skeleton that can be bent: joint places in the T-pose, turns, axes of its bones."""

    offsets: np.ndarray
    # by bone: the turn of it and its children from the T-pose, and its own axes there
    pose: dict[str, np.ndarray] = field(default_factory=dict)
    axes: dict[str, np.ndarray] = field(default_factory=dict)
    facing: np.ndarray = field(default_factory=lambda: IDENTITY)  # of the whole body
    without: tuple[str, ...] = ()
    twists: tuple[str, ...] = ()  # bones that hang from a twist bone half way up
    top: tuple[Node, ...] = (Node("Armature", -1),)
    scale: float = 1.0
    hips: tuple[float, float, float] = (0.0, 0.0, 0.0)  # off the place of its pelvis
    names: Callable[[str], str] = str

    def rig(self) -> Rig:
        worlds, places = self._world()
        nodes = list(self.top)
        number: dict[str, int] = {}
        top = Rig(self.top)
        base = (top.places[-1], top.rotations[-1], top.scales[-1])
        frames = {-1: base}
        for k, bone in enumerate(BONES):
            if bone in self.without:
                continue
            above = PARENTS[k]
            while above >= 0 and BONES[above] in self.without:
                above = PARENTS[above]
            parent = number[BONES[above]] if above >= 0 else len(self.top) - 1
            place, turn, scale = frames[above]
            local = rotate(inverse(turn), places[k] - place) / scale
            own = multiply(inverse(turn), worlds[k])
            if bone in self.twists:
                nodes.append(Node(f"{nodes[parent].name}_twist", parent, (local / 2).tolist()))
                parent, local = len(nodes) - 1, local / 2
            number[bone] = len(nodes)
            nodes.append(Node(self.names(bone), parent, local.tolist(), own.tolist()))
            frames[k] = (places[k], worlds[k], scale)
        return Rig(tuple(nodes))

    def _world(self) -> tuple[list[np.ndarray], list[np.ndarray]]:
        turns: list[np.ndarray] = []
        places: list[np.ndarray] = []
        for k, bone in enumerate(BONES):
            parent = PARENTS[k]
            above = turns[parent] if parent >= 0 else IDENTITY
            offset = self.scale * self.offsets[k]
            places.append((places[parent] if parent >= 0 else 0) + rotate(above, offset))
            turns.append(multiply(self.pose.get(bone, IDENTITY), above))
        worlds = [
            multiply(turn, self.axes.get(bone, IDENTITY))
            for bone, turn in zip(BONES, turns, strict=True)
        ]
        places[0] = places[0] + self.hips
        return (
            [multiply(self.facing, world) for world in worlds],
            [rotate(self.facing, place) for place in places],
        )


def offsets_of(gender: str, betas: list[float], basis: Basis = Basis.GLTF) -> np.ndarray:
    """rest_offsets of a body, as a server sends them [22, 3]."""
    body = load_body("anny52", gender, "low")
    joints = body.rest_joints(np.array(betas + [0.0] * (body.betas - len(betas))))
    joints[1:] -= joints[body.parents[1:]]
    return np.asarray(basis.axes.points_to_wire(joints))[: len(BONES)].round(6)


def vocabulary(column: str, prefix: str = "") -> Callable[[str], str]:
    table = {bone.name: prefix + getattr(bone, column) for bone in load_skeleton()}
    return table.__getitem__


SPINE = ("spine1", "spine2", "spine3")
RIGIFY = {
    "hip": "thigh.{}", "knee": "shin.{}", "ankle": "foot.{}", "foot": "toe.{}",
    "collar": "shoulder.{}", "shoulder": "upper_arm.{}", "elbow": "forearm.{}", "wrist": "hand.{}",
}  # fmt: skip
A_POSE = {
    "left_shoulder": turned("z", -48), "right_shoulder": turned("z", 48),
    "left_elbow": turned("y", -15), "right_elbow": turned("y", 15),
    "left_hip": turned("z", 6), "right_hip": turned("z", -6),
    "left_ankle": multiply(turned("y", 12), turned("z", -6)),
    "right_ankle": multiply(turned("y", -12), turned("z", 6)),
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A rig, and what is told of it besides."""

    name: str
    rig: Rig
    found_by: str
    basis: str = "gltf"
    humanoid: dict[str, int] | None = None

    @property
    def gltf(self) -> bool:
        return self.basis == "gltf"


def right_first(rig: Rig) -> Rig:
    """The same, with each bone of the right side in the list where the left one's was."""
    swapped = [
        bone.replace("left", "right") if "left" in bone else bone.replace("right", "left")
        for bone in BONES
    ]
    order = [0, *(1 + BONES.index(bone) for bone in swapped)]
    nodes = [rig.nodes[k] for k in order]
    return Rig(
        tuple(
            replace(node, parent=order.index(node.parent)) if node.parent >= 0 else node
            for node in nodes
        )
    )


def cases() -> list[Case]:
    """One of each kind."""
    own = offsets_of("female", [])
    tall = offsets_of("male", [1.5, -0.5])
    small = offsets_of("female", [-1.5])
    node = lambda rig, name: next(k for k, n in enumerate(rig.nodes) if n.name == name)  # noqa: E731
    vrm = Body(small, names=vocabulary("vrm", "J_Bip_"), without=("spine3",)).rig()
    vrm0 = Body(own, facing=TURN_ROUND, names=lambda bone: f"n{BONES.index(bone)}").rig()
    table = {bone.name: bone.vrm for bone in load_skeleton()}
    humanoid = {
        table[bone]: node(vrm, f"J_Bip_{table[bone]}") for bone in BONES if bone != "spine3"
    }
    humanoid0 = {table[bone]: node(vrm0, f"n{k}") for k, bone in enumerate(BONES)}
    centimetres = (
        Node("Armature", -1, rotation=(-ABOUT_X * [1, 1, 1, -1]).tolist(), scale=(0.01,) * 3),
    )
    mixamo, unreal, unity = vocabulary("mixamo"), vocabulary("ue"), vocabulary("unity")
    man = offsets_of("male", [1.0], Basis.UNITY), offsets_of("male", [1.0], Basis.UNREAL)
    limbs = tuple(f"{side}_{bone}" for side in ("left", "right") for bone in ("elbow", "knee"))
    fewer = ("spine2", "spine3", "left_collar", "right_collar", "left_foot", "right_foot")
    bodies = {
        "own": Body(own),
        "other_axes": Body(tall, axes=TILTED),
        "a_pose": Body(tall, pose=A_POSE, axes=TILTED, names=mixamo),
        "mixamo": Body(small, names=vocabulary("mixamo", "mixamorig:")),
        "unreal_names": Body(tall, axes=TILTED, names=unreal, pose=A_POSE),
        "twists": Body(own, twists=(*limbs, "left_wrist"), axes=TILTED, names=unreal),
        "missing_chest": Body(tall, without=fewer),
        "centimetres": Body(own, top=centimetres, axes=TILTED, names=vocabulary("mixamo", "Rig|")),
        "z_up": Body(own, facing=ABOUT_X, names=unity),
        "high_hips": Body(tall, hips=(0.0, 0.12, -0.05), axes=TILTED, pose=A_POSE, names=mixamo),
    }
    numbered = dict(zip(("pelvis", *SPINE, "neck", "head"), range(6), strict=True))
    bodies["numbered"] = Body(
        tall,
        names=lambda bone: (
            RIGIFY.get(bone[bone.find("_") + 1 :], "").format(bone[0].upper())
            or (f"spine.{numbered[bone]:03}" if numbered[bone] else "spine")
        ),
    )
    unnamed = Body(tall, pose=A_POSE, names=lambda bone: f"b{BONES.index(bone)}")
    return [
        *(Case(name, body.rig(), "names") for name, body in bodies.items()),
        Case("vrm1", vrm, "vrm", humanoid=humanoid),
        Case("vrm0", vrm0, "vrm", humanoid=humanoid0),
        Case("unnamed", unnamed.rig(), "shape"),
        Case("unnamed_right_first", right_first(unnamed.rig()), "shape"),
        Case("unity", Body(man[0], names=unity).rig(), "names", basis="unity"),
        Case("unreal", Body(man[1], names=unreal).rig(), "names", basis="unreal"),
    ]


@cache
def foreign_rigs() -> dict[str, Rig]:
    """By name: as Blender exports them, its Z up turned to glTF's axes, each bone's y along it."""
    data = json.loads(Path(__file__).with_name("foreign_rigs.json").read_text())
    return {name: _from_blender(bones) for name, bones in data["rigs"].items()}


def _from_blender(bones: list[tuple[str, int, list[float], list[float]]]) -> Rig:
    half = np.sqrt(0.5)
    nodes, worlds = [Node("Armature", -1, rotation=(-half, 0, 0, half))], [IDENTITY]
    for name, parent, head, tail in bones:
        along = np.subtract(tail, head)
        world = arc(np.array([0, 1.0, 0]), along) if along.any() else IDENTITY
        above, at = (worlds[parent + 1], bones[parent][2]) if parent >= 0 else (IDENTITY, (0, 0, 0))
        place = rotate(inverse(above), np.subtract(head, at))
        nodes.append(Node(name, parent + 1, place, multiply(inverse(above), world)))
        worlds.append(world)
    return Rig(tuple(nodes))
