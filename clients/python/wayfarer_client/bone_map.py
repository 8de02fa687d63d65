"""Maps nodes of a rig to bones: by VRM's table, otherwise by names, otherwise by shape.

clients/README.md, "Bones of a character", has the rules and the refusals.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from .bases import BASES, Basis
from .bones_by_name import SIDES, WORDS, by_names, by_vrm
from .bones_by_shape import Shape, contradicted
from .errors import InvalidArgument
from .rig import BONES, PARENTS, Rig

REQUIRED: Final = ("pelvis", *(f"{s}_{b}" for s in SIDES for b in ("hip", "knee", "ankle")))
TRUNK: Final = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
BRANCHING: Final = ("hip", "collar", "shoulder")
"""Bones that may hang from any bone of the trunk; they move with that bone."""
UNEVEN: Final = 1.01
"""Greatest ratio between the scales of a node's axes."""
HEELS: Final = 0.3
"""Greatest height of an ankle over the lowest node of its leg, as a share of the thigh's height."""
HINDLEGS: Final = (
    "legs as animals' hind legs, whose heels are off the ground, are not found by their shape. Say "
    "which bones these are, by a correction"
)
BACKWARD: Final = 0.2
"""Cosine of the angle up to which toes may point backwards."""


@dataclass(frozen=True)
class BoneMap:
    """A rig's nodes by canonical bone name, and how they were found."""

    rig: Rig
    bones: Mapping[str, int]
    found_by: str  # "vrm", "names", "shape"; "user" after a correction

    @property
    def missing(self) -> tuple[str, ...]:
        """Bones that the rig does not have; their children take over their rotations."""
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
    """The map of a rig. `humanoid`: VRM's names → nodes. `basis`: gives the up of the rig's space.
    `correct`: as for `BoneMap.corrected`; it also serves rigs that would be refused without it.
    Raises InvalidArgument that names what is missing, or why the rig is no biped.
    """
    bones, found_by = _found(rig, humanoid, basis)
    if correct:
        return BoneMap(rig, _checked(rig, _changed(rig, bones, correct)), "user")
    bones = _checked(rig, _kept(rig, bones))
    _check_biped(rig, bones, basis)
    return BoneMap(rig, bones, found_by)


def _found(
    rig: Rig, humanoid: Mapping[str, int] | None, basis: Basis
) -> tuple[dict[str, int], str]:
    """The bones found, enough or not, and how they were found."""
    if humanoid:
        return by_vrm(humanoid), "vrm"
    named = by_names(rig)
    if all(bone in named for bone in REQUIRED):
        return named, "names"
    shaped = Shape(rig, basis).bones()
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


def _kept(rig: Rig, bones: Mapping[str, int]) -> dict[str, int]:
    """The bones without optional ones whose place is impossible."""
    kept = {bone: bones[bone] for bone in BONES if bone in bones}
    for bone in BONES:
        if bone in kept and bone not in REQUIRED and _misplaced(rig, kept, bone) is not None:
            del kept[bone]
    return kept


def _misplaced(rig: Rig, bones: Mapping[str, int], bone: str) -> str | None:
    """The bone that this one wrongly hangs from or shares a node with; None: none."""
    node = bones[bone]
    above = next((b for k in rig.ancestors(node) for b, n in bones.items() if n == k), "")
    twin = next((b for b, n in bones.items() if n == node and b != bone), None)
    if twin is not None:
        return twin
    if not above or above in _line(bone):
        return None
    branches = bone.partition("_")[2] in BRANCHING or bone in TRUNK
    return None if branches and above in TRUNK and bone not in _line(above) else above


def _line(bone: str) -> list[str]:
    """The bones above a bone, up to the pelvis."""
    found, k = [], PARENTS[BONES.index(bone)]
    while k >= 0:
        found.append(BONES[k])
        k = PARENTS[k]
    return found


def _checked(rig: Rig, bones: Mapping[str, int]) -> dict[str, int]:
    """The bones in canonical order. Raises InvalidArgument if they are not a humanoid's."""
    lacking = [bone for bone in REQUIRED if bone not in bones]
    if lacking:
        roles = dict.fromkeys(bone.removeprefix("left_").removeprefix("right_") for bone in lacking)
        known = "; ".join(f"{role}: {', '.join(WORDS['roles'][role])}" for role in roles)
        raise InvalidArgument(
            f"no node was found for {', '.join(lacking)}, neither by names nor by shape: say which "
            "they are, by a correction. Known names, with sides as in LeftFoot, foot_l, foot.L: "
            f"{known}"
        )
    for bone in BONES:
        if bone in bones and (above := _misplaced(rig, bones, bone)) is not None:
            name = rig.nodes[bones[bone]].name
            is_twin = bones[above] == bones[bone]
            said = f"is {above}, too" if is_twin else f"hangs from {above}"
            raise InvalidArgument(f"{bone}: {name!r} {said}")
    for node in sorted({k for n in bones.values() for k in rig.ancestors(n)}):
        scale = np.asarray(rig.nodes[node].scale, float)
        if not 0 < scale.max() <= UNEVEN * scale.min():
            sizes = ", ".join(f"{size:g}" for size in scale)
            raise InvalidArgument(
                f"{rig.nodes[node].name!r} is scaled by {sizes}: bones below it would be sheared "
                "or mirrored as they turn. Apply its scale to the model, and export it again"
            )
    return {bone: bones[bone] for bone in BONES if bone in bones}


def _check_biped(rig: Rig, bones: dict[str, int], basis: Basis) -> None:
    """Raises InvalidArgument for animals, and for sides that contradict each other."""
    hips = [bones[f"{side}_hip"] for side in SIDES]
    others = Shape(rig, basis).other_legs(bones["pelvis"], hips)
    if others:
        legs = ", ".join(repr(rig.nodes[k].name) for k in (*hips, *others))
        raise InvalidArgument(f"it has four legs ({legs}): only what walks on two can be animated")
    name = contradicted(rig, bones)
    if name:
        raise InvalidArgument(
            f"{name!r} is on the other side than its name tells, by where the feet point: "
            f"{HINDLEGS}"
        )
    up = sum(rig.places[bones[f"{s}_hip"]] - rig.places[bones[f"{s}_ankle"]] for s in SIDES)
    high = rig.places @ up
    for side, hip in zip(SIDES, hips, strict=True):
        ankle = bones[f"{side}_ankle"]
        low = min(high[k] for k in rig.subtree(ankle))
        if high[ankle] - low > HEELS * (high[hip] - low) > 0:
            raise InvalidArgument(
                f"{rig.nodes[ankle].name!r} is high above the ground for an ankle: {HINDLEGS}"
            )
    toes = np.zeros(3)
    for side in SIDES:
        if f"{side}_foot" in bones:
            toes += rig.places[bones[f"{side}_foot"]] - rig.places[bones[f"{side}_ankle"]]
    forward = basis.handed * np.cross(rig.places[hips[0]] - rig.places[hips[1]], up)
    size = float(np.linalg.norm(toes) * np.linalg.norm(forward))
    if float(toes @ forward) < -BACKWARD * size:
        raise InvalidArgument(
            "its toes point backwards: left and right are exchanged, or these are no feet "
            f"({rig.nodes[hips[0]].name!r} counts as left)"
        )
