"""Bones of a rig by the words of its nodes' names: clients/README.md, "Bones of a character".

The words are in bone_names.json.
"""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from .rig import Rig

WORDS: Final[dict[str, Any]] = json.loads(
    Path(__file__).with_name("bone_names.json").read_text(encoding="utf-8")
)
SIDES: Final = ("left", "right")
SPINE: Final = ("spine1", "spine2", "spine3")
BREAKS: Final = re.compile(
    r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=[0-9])|(?<=[0-9])(?=[A-Za-z])"
)
TOKENS: Final = re.compile(r"[A-Za-z]+|[^\x00-\x7f]+")
LIMBS: Final = (
    ("hip", ""), ("knee", "hip"), ("ankle", "knee"), ("foot", "ankle"),
    ("shoulder", ""), ("elbow", "shoulder"), ("wrist", "elbow"), ("collar", ""),
)  # fmt: skip
"""Pairs of a role and the role of the bone that it hangs from."""


def words(name: str) -> tuple[str, str]:
    """Side ("left", "right", "") and rest of a name; ("", "") for helpers."""
    last = re.split(r"[:|]", name)[-1]
    tokens = [token.lower() for token in TOKENS.findall(BREAKS.sub(" ", last))]
    if any(token in WORDS["helpers"] for token in tokens):
        return "", ""
    side = ""
    rest = []
    for token in tokens:
        word = token
        for which in SIDES:
            mark = next((w for w in WORDS[which] if word == w or _begins(word, w)), "")
            if mark:
                side, word = which, word.removeprefix(mark)
        if word not in WORDS["noise"]:
            rest.append(word)
    return side, "".join(rest)


def _begins(token: str, mark: str) -> bool:
    """Whether a word in a script without spaces begins with its side."""
    return not mark.isascii() and token.startswith(mark)


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


def by_vrm(humanoid: Mapping[str, int]) -> dict[str, int]:
    """Bones by VRM's table: its names → nodes."""
    table = WORDS["vrm"]
    bones = {
        bone: humanoid[name] for bone, name in table.items() if bone != "spine" and name in humanoid
    }
    return bones | spread_spine([humanoid[name] for name in table["spine"] if name in humanoid])


def by_names(rig: Rig) -> dict[str, int]:
    """The bones that names reveal, enough for a humanoid or not."""
    return _Names(rig).bones


class _Names:
    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.words = [words(node.name) for node in rig.nodes]
        self.above = [rig.ancestors(k) for k in range(len(rig.nodes))]
        self.bones: dict[str, int] = {}
        for side in SIDES:
            for role, upper in LIMBS:
                self.find(f"{side}_{role}", role, side, self.bones.get(f"{side}_{upper}"))
        self.find("neck", "neck", "")
        self.find("head", "head", "", self.bones.get("neck"))
        self.find("pelvis", "pelvis", "")
        self.find_pelvis()
        self.find_spine()

    def find(self, bone: str, role: str, side: str, inside: int | None = None) -> None:
        """The uppermost node with the first of the role's words that any node has.
        Nodes below `inside` come first. Otherwise it may be anywhere: feet of IK rigs hang from
        the root. A word of two roles, such as `foot`, is not looked for there again.
        """
        for within in (inside,) if inside is None else (inside, None):
            for word in WORDS["roles"][role]:
                if within is None and inside is not None and role == "foot" and word == "foot":
                    continue
                found = [
                    k
                    for k, (has, rest) in enumerate(self.words)
                    if rest == word
                    and has == side
                    and k not in self.bones.values()
                    and (within is None or within in self.above[k])
                ]
                if found:
                    self.bones[bone] = min(found, key=lambda k: (len(self.above[k]), k))
                    return

    def top(self) -> list[int]:
        """The nodes at the end of the trunk: the neck, or the head, or both arms."""
        for bone in ("neck", "head"):
            if bone in self.bones:
                return [self.bones[bone]]
        arms = [self.bones.get(f"{s}_collar", self.bones.get(f"{s}_shoulder")) for s in SIDES]
        return [arm for arm in arms if arm is not None] if None not in arms else []

    def find_pelvis(self) -> None:
        """Moves the pelvis to the lowest node that carries both legs and the trunk."""
        legs = [self.bones[bone] for bone in ("left_hip", "right_hip") if bone in self.bones]
        if len(legs) < 2:
            return
        for carried in ([*legs, *self.top()], legs):
            shared = self.shared(carried)
            if self.bones.get("pelvis", -1) in shared:
                return
            if shared:
                self.bones["pelvis"] = shared[0]
                return

    def shared(self, nodes: list[int]) -> list[int]:
        """The common ancestors of these nodes, from below."""
        return [k for k in self.above[nodes[0]] if all(k in self.above[n] for n in nodes)]

    def find_spine(self) -> None:
        """The trunk's bones, from which no thigh hangs. Where rigs only number them, with neck and
        head, as Rigify does, where arms branch off tells them apart.
        """
        top = self.top()
        if not top or "pelvis" not in self.bones:
            return
        if len(top) == 1:
            self.bones |= spread_spine(self.trunk(top[0]))
            return
        chest = next(iter(self.shared(top)), None)
        if chest is None or self.bones["pelvis"] not in self.above[chest]:
            return
        chain, node = [], chest
        while True:
            onward = [k for k in self.rig.children[node] if self.plain(k)]
            if len(onward) != 1:
                break
            node = onward[0]
            chain.append(node)
        self.bones |= spread_spine([*self.trunk(chest), chest])
        rest = joints(self.rig, chain, 0.01 * float(np.ptp(self.rig.places, axis=0).max()))
        if len(rest) > 1:
            self.bones["neck"] = rest[0]
        if rest:
            self.bones["head"] = rest[-1]

    def trunk(self, top: int) -> list[int]:
        """Named nodes below this one, from the lowest, except ancestors of thighs."""
        found = []
        legs = [self.bones[bone] for bone in ("left_hip", "right_hip") if bone in self.bones]
        for k in self.above[top]:
            if any(k in self.above[leg] for leg in legs):
                break
            if self.plain(k):
                found.append(k)
        return found[::-1]

    def plain(self, node: int) -> bool:
        """Whether a node has a name without a side."""
        side, rest = self.words[node]
        return bool(rest) and not side


def joints(rig: Rig, path: list[int], least: float) -> list[int]:
    """The nodes of a path, without those nearer than `least` to the one kept before."""
    found: list[int] = []
    for k in path:
        if found and np.linalg.norm(rig.places[k] - rig.places[found[-1]]) < least:
            continue
        found.append(k)
    return found
