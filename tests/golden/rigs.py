"""Characters made from our own body, with other axes, poses, names, scales and missing bones; and
other people's characters (foreign_rigs.json).
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
from wayfarer.transport.conversion.basis import Basis
from wayfarer_client.bases import BASES
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
    """A rig, and additional information about it."""

    name: str
    rig: Rig
    found_by: str
    basis: str = "gltf"
    humanoid: dict[str, int] | None = None
    shod: bool = False  # it has shoes, of `shoes_of` its rig

    @property
    def gltf(self) -> bool:
        return self.basis == "gltf"


def right_first(rig: Rig) -> Rig:
    """The same rig, with each bone of the right side at the left one's place in the list."""
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


def rehung(rig: Rig, onto: dict[str, str]) -> Rig:
    """The same places and rotations, with other parents of some nodes, by name ("": none)."""
    names = [node.name for node in rig.nodes]
    above = [node.parent for node in rig.nodes]
    for name, other in onto.items():
        above[names.index(name)] = names.index(other) if other else -1
    order: list[int] = []
    while len(order) < len(names):
        order += [k for k in range(len(names)) if k not in order and above[k] in (-1, *order)]
    made = []
    for k in order:
        place, turn, scale = rig.places[k], rig.rotations[k], rig.scales[k]
        parent = above[k]
        if parent >= 0:
            back = inverse(rig.rotations[parent])
            place = rotate(back, place - rig.places[parent]) / rig.scales[parent]
            turn, scale = multiply(back, turn), scale / rig.scales[parent]
        number = order.index(parent) if parent >= 0 else -1
        turn = np.clip(turn, -1, 1)  # rounding: the validator minds 1 + 1e-16
        made.append(Node(names[k], number, place.tolist(), turn.tolist(), scale.tolist()))
    return Rig(tuple(made))


def grown(rig: Rig, onto: str, name: str, *places: tuple[float, float, float]) -> Rig:
    """The rig with a chain of bones at these places of its space, as for hair or a skirt."""
    nodes = list(rig.nodes)
    parent = next(k for k, node in enumerate(nodes) if node.name == onto)
    at, turn, scale = rig.places[parent], rig.rotations[parent], rig.scales[parent]
    for k, place in enumerate(places):
        local = rotate(inverse(turn), np.subtract(place, at)) / scale
        own = inverse(turn) if k == 0 else IDENTITY
        nodes.append(Node(f"{name}{k}", parent, local.tolist(), own.tolist()))
        parent, at, turn = len(nodes) - 1, np.array(place), IDENTITY
    return Rig(tuple(nodes))


def skirted(rig: Rig, hips: str, head: str) -> Rig:
    """The rig with a skirt and hair that reach the ground, at a person's size, Y up."""
    for side, x in (("L", 0.25), ("R", -0.25)):
        places = [(x, high, 0.05) for high in (0.9, 0.5, 0.03)]
        rig = grown(rig, hips, f"Skirt_{side}_", *places)
    hair = ((0, 1.5, -0.1), (0, 0.9, -0.2), (0, 0.4, -0.25), (0, 0.02, -0.3))
    return grown(rig, head, "Hair", *hair)


def shoes_of(rig: Rig, bones: dict[str, int], basis: str = "gltf") -> tuple[np.ndarray, np.ndarray]:
    """Corners [V, 3] of boxes about the feet of a rig that stands upright in its basis, and the
    node of each [V]: the soles are 2 cm below the toes' joints, and reach 12 cm before them.
    """
    axes = BASES[basis]
    unit = 100.0 if basis == "unreal" else 1.0
    places, nodes = [], []
    for side in ("left", "right"):
        ankle, toe = bones[f"{side}_ankle"], bones[f"{side}_foot"]
        low = float(rig.places[toe] @ axes.up) - 0.02 * unit
        for node, back, ahead in ((ankle, -0.07, 0.1), (toe, -0.01, 0.12)):
            at = rig.places[node]
            for along in (back, ahead):
                for beside in (-0.04, 0.05):
                    for high in (low, low + 0.05 * unit):
                        place = axes.level(at) + unit * (along * axes.forward + beside * axes.left)
                        places.append(place + high * axes.up)
                        nodes.append(node)
    return np.array(places), np.array(nodes)


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
    shod = ("own", "a_pose", "centimetres")
    return [
        *(Case(name, body.rig(), "names", shod=name in shod) for name, body in bodies.items()),
        *strange(tall, own),
        Case("vrm1", vrm, "vrm", humanoid=humanoid),
        Case("vrm0", vrm0, "vrm", humanoid=humanoid0),
        Case("unnamed", unnamed.rig(), "shape"),
        Case("unnamed_right_first", right_first(unnamed.rig()), "shape"),
        Case("unity", Body(man[0], names=unity).rig(), "names", basis="unity", shod=True),
        Case("unreal", Body(man[1], names=unreal).rig(), "names", basis="unreal"),
        Case("unreal_shod", Body(man[1], names=unreal).rig(), "names", basis="unreal", shod=True),
    ]


BIPED = {
    "pelvis": "Bip01 Pelvis", "spine1": "Bip01 Spine", "spine2": "Bip01 Spine1",
    "spine3": "Bip01 Spine2", "neck": "Bip01 Neck", "head": "Bip01 Head", "hip": "Thigh",
    "knee": "Calf", "ankle": "Foot", "foot": "Toe0", "collar": "Clavicle", "shoulder": "UpperArm",
    "elbow": "Forearm", "wrist": "Hand",
}  # fmt: skip
VRCHAT = {
    "pelvis": "Hips", "spine1": "Spine", "spine2": "Waist", "spine3": "Chest", "neck": "Neck",
    "head": "Head", "hip": "leg", "knee": "knee", "ankle": "ankle", "foot": "toe",
    "collar": "shoulder", "shoulder": "arm", "elbow": "elbow", "wrist": "wrist",
}  # fmt: skip
JAPANESE = {
    "pelvis": "下半身", "spine1": "上半身", "spine2": "上半身2", "spine3": "上半身3", "neck": "首",
    "head": "頭", "hip": "足", "knee": "ひざ", "ankle": "足首", "foot": "つま先", "collar": "肩",
    "shoulder": "腕", "elbow": "ひじ", "wrist": "手首",
}  # fmt: skip
DAZ = {
    "pelvis": "hip", "spine1": "abdomenLower", "spine2": "chestLower", "spine3": "chestUpper",
    "neck": "neckLower", "head": "head", "hip": "ThighBend", "knee": "Shin", "ankle": "Foot",
    "foot": "Toe", "collar": "Collar", "shoulder": "ShldrBend", "elbow": "ForearmBend",
    "wrist": "Hand",
}  # fmt: skip


def named(table: dict[str, str], sided: str, left: str, right: str) -> Callable[[str], str]:
    """Names of a tool; `sided`: how a side and a word are joined, as "{side} {word}"."""

    def name(bone: str) -> str:
        side, _, rest = bone.partition("_")
        if side not in ("left", "right"):
            return table[bone]
        return sided.format(side=left if side == "left" else right, word=table[rest])

    return name


def strange(tall: np.ndarray, own: np.ndarray) -> list[Case]:
    """Skeletons whose bones hang from other bones than they follow, and names of other tools."""
    biped = Body(tall, axes=TILTED, names=named(BIPED, "Bip01 {side} {word}", "L", "R")).rig()
    arms = {f"Bip01 {side} Clavicle": "Bip01 Neck" for side in "LR"}
    thighs = {f"Bip01 {side} Thigh": "Bip01 Spine" for side in "LR"}
    limbs = {role: name.removesuffix(".{}") for role, name in RIGIFY.items()}
    rigify = Body(own, names=named({**VRCHAT, **limbs}, "DEF-{word}.{side}", "L", "R"))
    apart = {
        f"DEF-{bone}.{side}": "Armature" for bone in ("foot", "forearm", "shin") for side in "LR"
    }
    vrchat = Body(own, names=named(VRCHAT, "{side} {word}", "Left", "Right")).rig()
    japanese = Body(tall, pose=A_POSE, names=named(JAPANESE, "{side}{word}", "左", "右")).rig()
    daz = Body(tall, pose=A_POSE, names=named(DAZ, "{side}{word}", "l", "r")).rig()
    unnamed = Body(own, names=lambda bone: f"b{BONES.index(bone)}")
    return [
        Case("thighs_under_spine", rehung(biped, thighs | arms), "names", shod=True),
        Case("limbs_hang_from_root", rehung(rigify.rig(), apart), "names", shod=True),
        Case("trunk_in_two_branches", rehung(rigify.rig(), {"Waist": "Armature"}), "names"),
        Case("trunk_hangs_from_nothing", rehung(rigify.rig(), {"Waist": ""}), "names"),
        Case("vrchat_skirt", skirted(vrchat, "Hips", "Head"), "names"),
        Case("japanese_skirt", skirted(japanese, "下半身", "頭"), "names"),
        Case("daz", daz, "names"),
        Case("unnamed_skirt", skirted(unnamed.rig(), "b0", "b15"), "shape"),
    ]


LEG = ("hip", "knee", "ankle", "foot")


def animal(digitigrade: bool = False, named: bool = True) -> Rig:
    """A rig without telling names: four legs, or two whose heels are off the ground."""
    nodes = [Node("Body", -1, (0, 0.8, 0))]

    def leg(top: int, name: str, x: float, *places: tuple[float, float]) -> None:
        for k, (high, ahead) in enumerate(places):
            above, aside = (top, x) if k == 0 else (len(nodes) - 1, 0.0)
            nodes.append(Node(f"{name}{k}", above, (aside, high, ahead)))

    if digitigrade:
        for side, x in (("L", 0.15), ("R", -0.15)):
            places = ((0, 0), (-0.08, 0), (-0.3, 0.15), (-0.2, -0.27), (-0.19, 0.14))
            leg(0, f"HindLeg_{side}_" if named else f"{x}_", x, *places)
        nodes.append(Node("Torso", 0, (0, 0.5, 0)))
        return Rig(tuple(nodes))
    nodes.append(Node("Torso", 0, (0, 0.05, 0.7)))
    for top, end in ((0, "Hind"), (1, "Fore")):
        for side, x in (("L", 0.14), ("R", -0.14)):
            leg(top, f"{end}{side}_", x, (0, 0), (-0.3, 0.04), (-0.25, -0.07), (-0.23, 0.08))
    return Rig(tuple(nodes))


def scaled(rig: Rig, top: str, scale: tuple[float, float, float]) -> Rig:
    """The rig with another scale of a node."""
    nodes = (replace(node, scale=scale) if node.name == top else node for node in rig.nodes)
    return Rig(tuple(nodes))


def refused() -> list[tuple[str, Rig, str]]:
    """(name, rig, what a refusal says among other things) of rigs that cannot walk."""
    own = offsets_of("female", [])
    mixamo = vocabulary("mixamo")

    def other(bone: str) -> str:
        side, _, rest = bone.partition("_")
        return mixamo({"left": f"right_{rest}", "right": f"left_{rest}"}.get(side, bone))

    exchanged = Body(own, names=other).rig()
    plain = Body(own, names=mixamo).rig()
    table = Rig((Node("table", -1), Node("leg1", 0, (0, -1, 0)), Node("leg2", 0, (1, -1, 0))))
    return [
        ("four_legs", animal(), "it has four legs"),
        ("digitigrade", animal(digitigrade=True), "on the other side than its name tells"),
        ("digitigrade_unnamed", animal(True, False), "is high above the ground for an ankle"),
        ("sides_exchanged", exchanged, "its toes point backwards"),
        ("uneven_scale", scaled(plain, "Armature", (1.0, 1.2, 1.0)), "is scaled by 1, 1.2, 1"),
        ("mirrored", scaled(plain, "Armature", (-1.0, 1.0, 1.0)), "is scaled by -1, 1, 1"),
        ("table", table, "no node was found for pelvis, left_hip"),
    ]


@cache
def foreign_rigs() -> dict[str, Rig]:
    """Rigs by name, as Blender exports them: Z up turned to glTF's axes, each bone's y along it."""
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
