"""Joints of a character at rest, upright: clients/README.md, "Retargeting", 1."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from .bases import BASES, Basis
from .bone_map import BoneMap
from .bones_by_name import SIDES
from .quaternions import Array, from_axes, rotate
from .rig import BONES

SNAP: Final = np.cos(np.radians(25))
"""Cosine: a rig's up or left that is this near to one of its axes is taken to be that axis."""
LEGS: Final = tuple(
    tuple(BONES.index(f"{side}_{bone}") for bone in ("hip", "knee", "ankle", "foot"))
    for side in SIDES
)


def character_joints(
    bone_map: BoneMap, basis: Basis = BASES["gltf"], floor: float | None = None
) -> tuple[dict[str, Array], float | None]:
    """Joints [3] of a character at rest by bone, upright in the basis; height of its floor.

    `floor`: the height of the floor, if its mesh gives it (`measure_soles`). The returned height is
    None when nothing gives it and the character does not stand at the origin's level.
    """
    turn = alignment(bone_map, basis)
    places = {bone: rotate(turn, bone_map.rig.places[n]) for bone, n in bone_map.bones.items()}
    numbered = {BONES.index(bone): place for bone, place in places.items()}
    if floor is None and stands(numbered, basis.up):
        floor = 0.0
    return places, floor


def alignment(bone_map: BoneMap, basis: Basis) -> Array:
    """The rotation from the character's axes to the basis, derived from its legs."""
    at = {BONES.index(bone): bone_map.rig.places[n] for bone, n in bone_map.bones.items()}
    up = _snapped(middle(at) - (at[LEGS[0][2]] + at[LEGS[1][2]]) / 2)
    left = at[LEGS[0][0]] - at[LEGS[1][0]]
    left = _snapped(left - (left @ up) * up)
    left = left - (left @ up) * up
    left /= np.linalg.norm(left)
    forward = basis.handed * np.cross(left, up)
    own = np.stack([left, up, forward], 1)
    return from_axes(np.stack([basis.left, basis.up, basis.forward], 1) @ own.T)


def middle(places: Mapping[int, Array] | Sequence[Array] | Array) -> Array:
    """Place of the pelvis, between the thigh joints: a rig's hips joint may be anywhere near it."""
    return np.asarray((places[LEGS[0][0]] + places[LEGS[1][0]]) / 2)


def lowest_joint(place: Mapping[int, Array], up: Array) -> float:
    """Height of the lowest ankle or ball."""
    return min(float(place[b] @ up) for leg in LEGS for b in leg[2:] if b in place)


def stands(place: Mapping[int, Array], up: Array) -> bool:
    """Whether its feet are so close above the origin's level that this is its floor."""
    lowest = lowest_joint(place, up)
    return 0 <= lowest <= 0.25 * (float(middle(place) @ up) - lowest)


def _snapped(direction: Array) -> Array:
    direction = direction / np.linalg.norm(direction)
    k = int(np.abs(direction).argmax())
    if abs(direction[k]) < SNAP:
        return np.asarray(direction)
    return np.asarray(np.eye(3)[k] * np.sign(direction[k]))
