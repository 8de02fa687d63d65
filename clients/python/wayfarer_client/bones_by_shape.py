"""Bones of a rig by its shape: clients/README.md, "Bones of a character"."""

from functools import cached_property
from typing import Final

import numpy as np

from .bases import Basis
from .bones_by_name import SIDES, joints, spread_spine, words
from .quaternions import Array
from .rig import Rig

LOW: Final = 0.1
"""A branch that ends below this share of the rig's height reaches the ground."""
APART: Final = 0.05
"""Least distance between the ends of two legs, as a share of that height."""
TOES: Final = 0.02
"""Least distance of toes before the ankle, as a share of that height."""
FAR: Final = 0.25
"""Least distance between two pairs of legs, as a share of that height."""


class Shape:
    """Branches of a rig that reach the ground, and the bones that follow from them."""

    def __init__(self, rig: Rig, basis: Basis) -> None:
        self.rig, self.basis = rig, basis
        self.height = rig.places @ basis.up
        self.tall = float(np.ptp(self.height)) if len(self.height) else 0.0

    @cached_property
    def below(self) -> list[list[int]]:
        """Each node with all its descendants."""
        return [self.rig.subtree(k) for k in range(len(self.rig.nodes))]

    @cached_property
    def lowest(self) -> list[int]:
        """The lowest of these, for each node."""
        return [min(nodes, key=lambda n: self.height[n]) for nodes in self.below]

    @cached_property
    def pairs(self) -> list[tuple[int, list[int], list[int]]]:
        """Nodes with two branches that reach the ground apart from each other; with the joints of
        both, three or more each.
        """
        found = []
        ground = self.height.min() + LOW * self.tall if self.tall > 0 else -np.inf
        for k, children in enumerate(self.rig.children):
            feet = [c for c in children if self.height[self.lowest[c]] < ground]
            chains = [self.chain(c) for c in feet]
            for a in range(len(feet)):
                for b in range(a + 1, len(feet)):
                    ends = [self.rig.places[self.lowest[feet[n]]] for n in (a, b)]
                    gap = float(np.linalg.norm(self.basis.level(ends[0] - ends[1])))
                    if min(len(chains[a]), len(chains[b])) >= 3 and gap > APART * self.tall:
                        found.append((k, chains[a], chains[b]))
        return found

    def chain(self, leg: int) -> list[int]:
        """The joints from a node to the lowest below it."""
        return joints(self.rig, _path(self.rig, leg, self.lowest[leg]), 0.03 * self.tall)

    def toes(self, chain: list[int]) -> Array:
        """Where the toes of a leg point [3], level."""
        last = chain[min(3, len(chain) - 1)]
        return self.basis.level(self.rig.places[last] - self.rig.places[chain[2]])

    def other_legs(self, pelvis: int, hips: list[int]) -> list[int] | None:
        """A pair of legs [2] of the same body that hangs far from these two; None: none does."""
        line = {pelvis, *self.rig.ancestors(pelvis), *self.below[pelvis]}
        own = {node for hip in hips for node in (hip, *self.rig.ancestors(hip))}
        middle = np.mean([self.rig.places[hip] for hip in hips], axis=0)
        for above, *chains in self.pairs:
            tops = [chain[0] for chain in chains]
            if above not in line or own & set(tops):
                continue
            away = np.mean([self.rig.places[top] for top in tops], axis=0) - middle
            if np.linalg.norm(self.basis.level(away)) > FAR * self.tall:
                return tops
        return None

    def bones(self) -> dict[str, int]:
        """The bones that the shape reveals, enough for a humanoid or not."""
        walking = [
            pair
            for pair in self.pairs
            if all(np.linalg.norm(self.toes(chain)) >= TOES * self.tall for chain in pair[1:])
        ]
        if not walking:  # no toes: nothing tells front from back, or a leg from a skirt
            return {}
        pelvis, *chains = walking[-1]  # nodes come parents first: the deepest
        forward = self.toes(chains[0]) + self.toes(chains[1])
        if np.linalg.norm(forward) < 0.01 * self.tall:
            return {}
        left = self.basis.handed * np.cross(self.basis.up, forward)
        left /= np.linalg.norm(left)
        across = self.rig.places[chains[0][0]] - self.rig.places[chains[1][0]]
        if self.basis.level(across) @ left < 0:
            chains.reverse()
        bones = {"pelvis": pelvis}
        for side, chain in zip(SIDES, chains, strict=True):
            names = (f"{side}_{b}" for b in ("hip", "knee", "ankle", "foot"))
            bones |= dict(zip(names, chain, strict=False))
        top = max(self.below[pelvis], key=lambda n: self.height[n])
        return bones | self.upper(_path(self.rig, pelvis, top)[1:], left)

    def upper(self, spine: list[int], left: Array) -> dict[str, int]:
        """The trunk's bones, by where arms branch off on both sides."""
        rig, side_of = self.rig, self.rig.places @ left
        for k, chest in enumerate(spine):
            arms = [c for c in rig.children[chest] if c not in spine]
            reach = {c: max(self.below[c], key=lambda n: abs(side_of[n])) for c in arms}
            out = {c: side_of[reach[c]] - side_of[chest] for c in arms}
            lefts = [c for c in arms if out[c] > 0.15 * self.tall]
            rights = [c for c in arms if out[c] < -0.15 * self.tall]
            if not (lefts and rights):
                continue
            bones = spread_spine(spine[: k + 1])
            for side, arm in (("left", lefts[0]), ("right", rights[0])):
                chain = []
                for node in joints(rig, _path(rig, arm, reach[arm]), 0.02 * self.tall):
                    chain.append(node)
                    if len(rig.children[node]) >= 3:  # the hand: fingers begin
                        break
                names = ("collar", "shoulder", "elbow", "wrist")[-4 if len(chain) >= 4 else -3 :]
                bones |= dict(zip((f"{side}_{b}" for b in names), chain[-4:], strict=False))
            rest = joints(rig, spine[k + 1 :], 0.01 * self.tall)
            if len(rest) == 1:
                return bones | {"head": rest[0]}
            return bones | dict(zip(("neck", "head"), rest, strict=False))
        return spread_spine(spine[:1])


def contradicted(rig: Rig, bones: dict[str, int]) -> str:
    """A node of a limb whose name gives the other side than its bone. "": none, or as many names
    agree with the side that was found.
    """
    against, votes = "", 0
    for bone, node in bones.items():
        side, has = bone.partition("_")[0], words(rig.nodes[node].name)[0]
        if side in SIDES and has:
            votes += 1 if has == side else -1
            if has != side:
                against = against or rig.nodes[node].name
    return against if votes < 0 else ""


def _path(rig: Rig, top: int, bottom: int) -> list[int]:
    line = [bottom, *rig.ancestors(bottom)]
    return line[: line.index(top) + 1][::-1]
