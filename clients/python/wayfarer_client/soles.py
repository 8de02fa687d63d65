"""Soles of a character, from its mesh at rest: clients/README.md, "Retargeting", 5."""

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from .bases import BASES, Basis
from .bone_map import BoneMap
from .joints import LEGS, alignment
from .quaternions import Array, inverse, rotate
from .rig import BONES

STEEP: Final = (0.0, 45.0, 75.0)
"""Outermost points are looked for in these directions: degrees off straight down."""
ROUND: Final = 8
"""Number of directions around the vertical, for each of these angles."""


HEEL: Final = 0.34
"""Distance of the heel behind the ankle, as a share of the way from ankle to ball."""
TIP: Final = 0.38
"""Distance of the tip of the toes before the ball, as a share of that way."""


@dataclass(frozen=True)
class Sole:
    """A foot in the T-pose: what of it touches the ground, relative to the ankle joint."""

    ball: Array  # [3] on the ground, below the joint of the toes
    heel: Array  # [3] on the ground
    joint: Array  # [3] about which `toes` turn
    fixed: Array  # [N, 3] points that turn with the ankle
    toes: Array  # [M, 3] points that turn with the toes, relative to `joint`

    @classmethod
    def of_joints(cls, toe: Array, height: float, basis: Basis) -> "Sole":
        """A foot of which only the joints are known: the toes' [3] from the ankle, which is at this
        height.
        """
        ahead = basis.level(toe)
        ball, heel = ahead - height * basis.up, -HEEL * ahead - height * basis.up
        under = ball - toe
        return cls(ball, heel, toe, np.stack([heel, ball]), np.stack([under, under + TIP * ahead]))

    def lowest(self, ankle: Array, toe: Array, up: Array) -> float:
        """Height of its lowest point over the ankle, when ankle and toes are turned [4]."""
        low = float((self.fixed @ rotate(inverse(ankle), up)).min(initial=np.inf))
        if len(self.toes):
            joint = float(rotate(ankle, self.joint) @ up)
            low = min(low, joint + float((self.toes @ rotate(inverse(toe), up)).min()))
        return low


@dataclass(frozen=True)
class Soles:
    """Points of the mesh that may touch the ground, in the basis, at rest."""

    floor: float
    """Height of the lowest of them."""
    feet: tuple[tuple[Array, Array], tuple[Array, Array]] = field(repr=False)
    """For the left and the right foot: [N, 3] points that the ankle moves, from the ankle's joint,
    and [M, 3] points that the toes move, from the toes' joint.
    """


def measure_soles(
    bone_map: BoneMap, places: Array, nodes: Array, basis: Basis = BASES["gltf"]
) -> Soles | None:
    """The soles of a character. `places` [V, 3] are its mesh's vertices at rest, in its own space;
    `nodes` [V] is the node of the rig that moves each most.

    None: a foot has no vertices, or they end above its ankle.
    """
    rig = bone_map.rig
    turn = alignment(bone_map, basis)
    numbers = {node: BONES.index(bone) for bone, node in bone_map.bones.items()}
    owner = np.array(
        [
            next((numbers[n] for n in (node, *rig.ancestors(node)) if n in numbers), -1)
            for node in range(len(rig.nodes))
        ]
    )
    moved = owner[nodes]
    directions = _directions(basis)
    feet, floor = [], np.inf
    for _, _, ankle, toe in LEGS:
        parts = []
        for bone in (ankle, toe):
            if BONES[bone] not in bone_map.bones:
                parts.append(np.zeros((0, 3)))
                continue
            joint = rotate(turn, rig.places[bone_map.bones[BONES[bone]]])
            # rows are turned as by `rotate`: its matrix has the turned axes as columns
            found = places[moved == bone] @ np.stack([rotate(turn, axis) for axis in np.eye(3)])
            if len(found):
                floor = min(floor, float((found @ basis.up).min()))
                found = found[np.unique((directions @ found.T).argmax(1))]
            parts.append(found - joint)
        ankle_at = float(rotate(turn, rig.places[bone_map.bones[BONES[ankle]]]) @ basis.up)
        if not any(map(len, parts)) or floor >= ankle_at:
            return None
        feet.append((parts[0], parts[1]))
    return Soles(floor, (feet[0], feet[1]))


def _directions(basis: Basis) -> Array:
    """Directions [D, 3]: down, and obliquely down all around."""
    found = [-basis.up]
    for degrees in STEEP[1:]:
        steep = np.radians(degrees)
        for k in range(ROUND):
            angle = 2 * np.pi * k / ROUND
            beside = np.cos(angle) * basis.forward + np.sin(angle) * basis.left
            found.append(np.sin(steep) * beside - np.cos(steep) * basis.up)
    return np.stack(found)
