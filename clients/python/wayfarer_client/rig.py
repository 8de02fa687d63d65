"""A character's skeleton at rest, as its file has it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .errors import InvalidArgument
from .quaternions import IDENTITY, Array, multiply, rotate

BONES = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2"),
    *("left_ankle", "right_ankle", "spine3", "left_foot", "right_foot", "neck"),
    *("left_collar", "right_collar", "head", "left_shoulder", "right_shoulder"),
    *("left_elbow", "right_elbow", "left_wrist", "right_wrist"),
)
"""The 22 bones of a stream's profile `body`, in order."""
PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)


@dataclass(frozen=True)
class Node:
    """A node of the file, parents before children: its rest transform relative to its parent."""

    name: str
    parent: int  # -1: none
    position: Sequence[float] = (0.0, 0.0, 0.0)
    rotation: Sequence[float] = (0.0, 0.0, 0.0, 1.0)
    scale: Sequence[float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Rig:
    """Nodes, and where they are at rest in the character's own space."""

    nodes: tuple[Node, ...]

    def __post_init__(self) -> None:
        for k, node in enumerate(self.nodes):
            if not -1 <= node.parent < k:
                raise InvalidArgument(f"node {k} ({node.name}): its parent must stand before it")

    @cached_property
    def rotations(self) -> Array:
        """[N, 4] of the nodes in the character's space."""
        found = np.zeros((len(self.nodes), 4))
        for k, node in enumerate(self.nodes):
            own = np.asarray(node.rotation, float)
            above = found[node.parent] if node.parent >= 0 else IDENTITY
            found[k] = multiply(above, own / np.linalg.norm(own))
        return found

    @cached_property
    def scales(self) -> Array:
        """[N, 3] products of scales from the top; right if each is equal along all axes."""
        found = np.ones((len(self.nodes), 3))
        for k, node in enumerate(self.nodes):
            found[k] = np.asarray(node.scale, float)
            if node.parent >= 0:
                found[k] *= found[node.parent]
        return found

    @cached_property
    def places(self) -> Array:
        """[N, 3] of the nodes in the character's space."""
        found = np.zeros((len(self.nodes), 3))
        for k, node in enumerate(self.nodes):
            found[k] = node.position
            if node.parent >= 0:
                offset = self.scales[node.parent] * found[k]
                found[k] = found[node.parent] + rotate(self.rotations[node.parent], offset)
        return found

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """The children of each node."""
        found: list[list[int]] = [[] for _ in self.nodes]
        for k, node in enumerate(self.nodes):
            if node.parent >= 0:
                found[node.parent].append(k)
        return tuple(map(tuple, found))

    def ancestors(self, node: int) -> list[int]:
        """Its ancestors, from the parent to the top."""
        found = []
        while (node := self.nodes[node].parent) >= 0:
            found.append(node)
        return found

    def subtree(self, node: int) -> list[int]:
        """A node and all below it, level by level."""
        found = [node]
        for k in found:
            found.extend(self.children[k])
        return found
