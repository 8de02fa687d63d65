"""Which node of a rig is which bone: by VRM's table, else by names, else by shape.

clients/README.md, "Bones of a character". Words of names are in bone_names.json.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from .bases import BASES, Basis
from .errors import InvalidArgument
from .rig import BONES, Rig

WORDS: Final[dict[str, Any]] = json.loads(
    Path(__file__).with_name("bone_names.json").read_text(encoding="utf-8")
)
SIDES: Final = ("left", "right")
REQUIRED: Final = ("pelvis", *(f"{s}_{b}" for s in SIDES for b in ("hip", "knee", "ankle")))
SPINE: Final = ("spine1", "spine2", "spine3")
BREAKS: Final = re.compile(
    r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=[0-9])|(?<=[0-9])(?=[A-Za-z])"
)


@dataclass(frozen=True)
class BoneMap:
    """A rig's nodes by canonical bone name, and how they were found."""

    rig: Rig
    bones: Mapping[str, int]
    found_by: str  # "vrm", "names", "shape"; "user" after a correction

    @property
    def missing(self) -> tuple[str, ...]:
        """Bones that the rig does not have; their turns go on into their children."""
        return tuple(bone for bone in BONES if bone not in self.bones)

    def table(self) -> dict[str, str]:
        """Canonical name → name of the node: to show it, or keep it."""
        nodes = self.rig.nodes
        return {bone: nodes[self.bones[bone]].name for bone in BONES if bone in self.bones}

    def corrected(self, changes: Mapping[str, str | None]) -> "BoneMap":
        """The map with other nodes for some bones (by node name), or without them (None)."""
        bones = _changed(self.rig, self.bones, changes)
        return replace(self, bones=_checked(self.rig, bones), found_by="user")


def map_bones(
    rig: Rig,
    humanoid: Mapping[str, int] | None = None,
    basis: Basis = BASES["gltf"],
    correct: Mapping[str, str | None] | None = None,
) -> BoneMap:
    """The map of a rig. `humanoid`: VRM's names → nodes; `basis`: of the rig's space, for its up;
    `correct`: as `BoneMap.corrected`, also of what would be refused without.

    Raises InvalidArgument that names the hips or legs that are missing.
    """
    bones, found_by = _found(rig, humanoid, basis)
    if correct:
        return BoneMap(rig, _checked(rig, _changed(rig, bones, correct)), "user")
    return BoneMap(rig, _checked(rig, bones), found_by)


def _found(
    rig: Rig, humanoid: Mapping[str, int] | None, basis: Basis
) -> tuple[Mapping[str, int], str]:
    """What is found, enough or not, and how."""
    if humanoid:
        return _by_vrm(humanoid), "vrm"
    named = _by_names(rig)
    if all(bone in named for bone in REQUIRED):
        return named, "names"
    shaped = _by_shape(rig, basis)
    if all(bone in shaped for bone in REQUIRED):
        return shaped, "shape"
    return named, "names"


def _changed(
    rig: Rig, found: Mapping[str, int], changes: Mapping[str, str | None]
) -> dict[str, int]:
    names = [node.name for node in rig.nodes]
    bones = dict(found)
    for bone, name in changes.items():
        if bone not in BONES:
            raise InvalidArgument(f"{bone!r} is no bone; bones are {', '.join(BONES)}")
        bones.pop(bone, None)
        if name is not None:
            if name not in names:
                raise InvalidArgument(f"{bone}: the rig has no node {name!r}")
            bones[bone] = names.index(name)
    return bones


def _checked(rig: Rig, bones: Mapping[str, int]) -> dict[str, int]:
    lacking = [bone for bone in REQUIRED if bone not in bones]
    if lacking:
        raise InvalidArgument(
            f"neither names nor shape of this rig tell its {', '.join(lacking)}: "
            "say which nodes these are, by a correction"
        )
    for side in SIDES:
        for upper, lower in (("hip", "knee"), ("knee", "ankle")):
            high, low = bones[f"{side}_{upper}"], bones[f"{side}_{lower}"]
            if high not in rig.ancestors(low):
                name = rig.nodes[low].name
                raise InvalidArgument(f"{side}_{lower}: {name!r} does not hang from the {upper}")
        if bones["pelvis"] not in rig.ancestors(bones[f"{side}_hip"]):
            raise InvalidArgument(f"{side}_hip does not hang from the pelvis")
    found = {bone: bones[bone] for bone in BONES if bone in bones}
    names = {node: bone for bone, node in found.items()}
    for bone, node in found.items():
        above = next((names[k] for k in rig.ancestors(node) if k in names), None)
        top = bone == "pelvis"
        if (above is None) != top or (above and BONES.index(above) > BONES.index(bone)):
            raise InvalidArgument(
                f"{bone}: {rig.nodes[node].name!r} hangs from {above or 'no bone'}"
            )
    return found


def spread_spine(chain: list[int]) -> dict[str, int]:
    """Nodes between pelvis and neck → spine bones: the last, from which arms hang, is spine3."""
    count = len(chain)
    if count == 0:
        return {}
    if count == 1:
        return {"spine3": chain[0]}
    if count == 2:
        return {"spine1": chain[0], "spine3": chain[1]}
    return {bone: chain[(k * (count - 1) + 1) // 2] for k, bone in enumerate(SPINE)}


def _by_vrm(humanoid: Mapping[str, int]) -> dict[str, int]:
    table = WORDS["vrm"]
    bones = {
        bone: humanoid[name] for bone, name in table.items() if bone != "spine" and name in humanoid
    }
    return bones | spread_spine([humanoid[name] for name in table["spine"] if name in humanoid])


def _words(name: str) -> tuple[str, str]:
    """Side ("left", "right", "") and the rest of a name; helpers give ("", "")."""
    last = re.split(r"[:|]", name)[-1]
    tokens = [t.lower() for t in re.split(r"[^A-Za-z]+", BREAKS.sub(" ", last)) if t]
    if any(token in WORDS["helpers"] for token in tokens):
        return "", ""
    side = ""
    rest = []
    for token in tokens:
        if token in WORDS["left"]:
            side = "left"
        elif token in WORDS["right"]:
            side = "right"
        elif token not in WORDS["noise"]:
            rest.append(token)
    return side, "".join(rest)


def _by_names(rig: Rig) -> dict[str, int]:
    words = [_words(node.name) for node in rig.nodes]
    depth = [len(rig.ancestors(k)) for k in range(len(rig.nodes))]
    bones: dict[str, int] = {}

    def find(bone: str, role: str, side: str, inside: int | None = None) -> None:
        for word in WORDS["roles"][role]:
            found = [
                k
                for k, (has, rest) in enumerate(words)
                if rest == word
                and has == side
                and k not in bones.values()
                and (inside is None or inside in rig.ancestors(k))
            ]
            if found:
                bones[bone] = min(found, key=lambda k: (depth[k], k))
                return

    for side in SIDES:
        for role, above in (("hip", None), ("knee", "hip"), ("ankle", "knee"), ("foot", "ankle")):
            find(f"{side}_{role}", role, side, bones.get(f"{side}_{above}"))
        find(f"{side}_shoulder", "shoulder", side)
        for role, above in (("elbow", "shoulder"), ("wrist", "elbow")):
            find(f"{side}_{role}", role, side, bones.get(f"{side}_{above}"))
        find(f"{side}_collar", "collar", side)
    find("pelvis", "pelvis", "")
    legs = [bones[bone] for bone in ("left_hip", "right_hip") if bone in bones]
    if len(legs) == 2:
        shared = [k for k in rig.ancestors(legs[0]) if k in rig.ancestors(legs[1])]
        if bones.get("pelvis", -1) not in shared and shared:
            bones["pelvis"] = shared[0]
    find("neck", "neck", "")
    find("head", "head", "", bones.get("neck"))
    top = bones.get("neck", bones.get("head"))
    if "pelvis" in bones and top is not None:
        bones |= spread_spine(_between(rig, bones["pelvis"], top, words))
    elif "pelvis" in bones:
        bones |= _trunk(rig, bones, words)
    return bones


def _trunk(rig: Rig, bones: dict[str, int], words: list[tuple[str, str]]) -> dict[str, int]:
    """Spine, neck and head of a rig that only numbers them, as Rigify: by where arms branch off."""
    arms = [bones.get(f"{side}_collar", bones.get(f"{side}_shoulder")) for side in SIDES]
    if arms[0] is None or arms[1] is None:
        return {}
    chest = next((k for k in rig.ancestors(arms[0]) if k in rig.ancestors(arms[1])), None)
    if chest is None or bones["pelvis"] not in rig.ancestors(chest):
        return {}
    chain, node = [], chest
    while True:
        onward = [k for k in rig.children[node] if words[k][1] and not words[k][0]]
        if len(onward) != 1:
            break
        node = onward[0]
        chain.append(node)
    found = spread_spine([*_between(rig, bones["pelvis"], chest, words), chest])
    rest = _joints(rig, chain, 0.01 * float(np.ptp(rig.places, axis=0).max()))
    if len(rest) > 1:
        found["neck"] = rest[0]
    if rest:
        found["head"] = rest[-1]
    return found


def _between(
    rig: Rig, low: int, high: int, words: list[tuple[str, str]] | None = None
) -> list[int]:
    """Nodes between two, from low to high, without helpers; none when not on one line."""
    line = rig.ancestors(high)
    if low not in line:
        return []
    found = line[: line.index(low)][::-1]
    return [k for k in found if words is None or words[k][1]]


def _by_shape(rig: Rig, basis: Basis) -> dict[str, int]:
    """Legs end lowest, the spine goes up between them, arms branch to both sides of it."""
    height = rig.places @ basis.up
    tall = float(np.ptp(height)) if len(height) else 0.0
    if tall <= 0:
        return {}
    below = [_subtree(rig, k) for k in range(len(rig.nodes))]
    lowest = [min(nodes, key=lambda n: height[n]) for nodes in below]
    best: tuple[int, int, int] | None = None
    for k, children in enumerate(rig.children):
        feet = [c for c in children if height[lowest[c]] < height.min() + 0.1 * tall]
        for a in range(len(feet)):
            for b in range(a + 1, len(feet)):
                gap = basis.level(rig.places[lowest[feet[a]]] - rig.places[lowest[feet[b]]])
                if np.linalg.norm(gap) > 0.05 * tall:
                    best = (k, feet[a], feet[b])  # nodes come parents first: the deepest stays
    if best is None:
        return {}
    pelvis, *legs = best
    chains = [_joints(rig, _path(rig, leg, lowest[leg]), 0.03 * tall) for leg in legs]
    if any(len(chain) < 3 for chain in chains):
        return {}
    toes = sum(
        (rig.places[chain[min(3, len(chain) - 1)]] - rig.places[chain[2]] for chain in chains),
        np.zeros(3),
    )
    forward = basis.level(toes)
    across = basis.level(rig.places[legs[0]] - rig.places[legs[1]])
    if np.linalg.norm(forward) < 0.01 * tall:  # no toes: nothing tells front from back
        return {}
    left = basis.handed * np.cross(basis.up, forward)
    if across @ left < 0:
        chains.reverse()
    bones = {"pelvis": pelvis}
    for side, chain in zip(SIDES, chains, strict=True):
        bones |= dict(
            zip((f"{side}_{b}" for b in ("hip", "knee", "ankle", "foot")), chain, strict=False)
        )
    top = max(below[pelvis], key=lambda n: height[n])
    spine = _path(rig, pelvis, top)[1:]
    return bones | _upper(rig, spine, below, left / np.linalg.norm(left), tall)


def _upper(
    rig: Rig, spine: list[int], below: list[list[int]], left: np.ndarray, tall: float
) -> dict[str, int]:
    side_of = rig.places @ left
    for k, chest in enumerate(spine):
        arms = [c for c in rig.children[chest] if c not in spine]
        reach = {c: max((n for n in below[c]), key=lambda n: abs(side_of[n])) for c in arms}
        far = [c for c in arms if abs(side_of[reach[c]] - side_of[chest]) > 0.15 * tall]
        lefts = [c for c in far if side_of[reach[c]] > side_of[chest]]
        rights = [c for c in far if side_of[reach[c]] < side_of[chest]]
        if not (lefts and rights):
            continue
        bones = spread_spine(spine[: k + 1])
        for side, arm in (("left", lefts[0]), ("right", rights[0])):
            chain = []
            for node in _joints(rig, _path(rig, arm, reach[arm]), 0.02 * tall):
                chain.append(node)
                if len(rig.children[node]) >= 3:  # the hand: fingers begin
                    break
            names = ("collar", "shoulder", "elbow", "wrist")[-4 if len(chain) >= 4 else -3 :]
            bones |= dict(zip((f"{side}_{b}" for b in names), chain[-4:], strict=False))
        rest = _joints(rig, spine[k + 1 :], 0.01 * tall)
        if len(rest) == 1:
            return bones | {"head": rest[0]}
        return bones | dict(zip(("neck", "head"), rest, strict=False))
    return spread_spine(spine[:1])


def _subtree(rig: Rig, node: int) -> list[int]:
    found = [node]
    for k in found:
        found.extend(rig.children[k])
    return found


def _path(rig: Rig, top: int, bottom: int) -> list[int]:
    line = [bottom, *rig.ancestors(bottom)]
    return line[: line.index(top) + 1][::-1]


def _joints(rig: Rig, path: list[int], least: float) -> list[int]:
    """Of a path, those at least so far from the one before: the later of two at one place."""
    found: list[int] = []
    for k in path:
        if found and np.linalg.norm(rig.places[k] - rig.places[found[-1]]) < least:
            continue
        found.append(k)
    return found
