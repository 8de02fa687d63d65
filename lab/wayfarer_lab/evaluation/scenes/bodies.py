"""Bodies as things that can touch: their skin, and capsules around their bones."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.world.agents.agent import AgentSpec

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

TRUNK: Final = (
    ("left_hip", "right_hip", ("pelvis",)),
    ("spine1", "spine2", ("spine1", "spine2")),
    ("left_shoulder", "right_shoulder", ("spine3", "left_collar", "right_collar")),
)
LIMBS: Final = (
    ("hip", "knee", ("hip",)),
    ("knee", "ankle", ("knee",)),
    ("ankle", "foot", ("ankle", "foot")),
    ("shoulder", "elbow", ("shoulder",)),
    ("elbow", "wrist", ("elbow",)),
    ("wrist", "middle1", ("wrist",)),
)
"""Capsules: their two joints, and the joints whose skin they represent. Limbs are on both sides.

The trunk is wider than deep, so hips and chest are capsules that lie across it.
"""

HEAD: Final = "head"
"""Its skin lies beyond its joint: a ball around the middle of that skin stands for it."""

FEET: Final = ("ankle", "foot")
"""Their skin is on the ground, not in it."""


@dataclass(frozen=True)
class Capsules:
    """Round pieces of a body. An end is a joint's place and an offset that turns with it."""

    joints: Index  # [C, 2]
    offsets: Array  # [C, 2, 3] metres, in the T-pose
    radii: Array  # [C]


@dataclass(frozen=True)
class PosedBodies:
    """R bodies, each in one frame. J joints, C capsules."""

    turns: Array  # [R, J, 3, 3] world
    places: Array  # [R, J, 3] world
    start: Array  # [R, C, 3] ends of capsules
    end: Array  # [R, C, 3]
    radii: Array  # [R, C]


@dataclass(frozen=True)
class Form:
    """A body of one shape."""

    body: BodyModel
    betas: Array  # [B]

    @classmethod
    def of(cls, body: BodyModel, spec: AgentSpec) -> "Form":
        """The body of an agent."""
        return cls(body, np.asarray(spec.betas))

    @cached_property
    def rest(self) -> Array:
        """Joints of the T-pose. [J, 3]"""
        return self.body.rest_joints(self.betas)

    @cached_property
    def capsules(self) -> Capsules:
        """Radii are median distances from the skin of the T-pose to the capsule's line."""
        skin = self.body.rest_vertices(self.betas)
        joints, offsets, radii = [], [], []
        for a, b, owners in _bones():
            line = np.array([self._joint(a), self._joint(b)])
            offset = np.zeros((2, 3))
            mine = skin[np.isin(self._owner, [self._joint(name) for name in owners])]
            if HEAD in owners:
                offset[:] = mine.mean(0) - self.rest[line]
            joints.append(line)
            offsets.append(offset)
            radii.append(np.median(_from_line(mine, *(self.rest[line] + offset))))
        return Capsules(np.array(joints), np.array(offsets), np.array(radii))

    @cached_property
    def feet(self) -> NDArray[np.bool_]:
        """Which vertices are feet. [V]"""
        names = np.array([name.endswith(FEET) for name in self.body.joint_names])
        return names[self._owner]

    def skin(self, turns: Array, places: Array) -> Array:
        """Skin of poses: turns [T, J, 3, 3], places [T, J, 3]. [T, V, 3]"""
        return self.body.skin(self.betas, turns, places)

    def soles(self, turns: Array, places: Array) -> Array:
        """Markers under both feet, left first. [T, 2, 4, 3]"""
        under = self.body.marker_vertices[self.body.sole_markers]
        return self.body.skin(self.betas, turns, places, under).reshape(len(places), 2, -1, 3)

    @cached_property
    def _owner(self) -> Index:
        """The joint that moves each vertex most. [V]"""
        most = self.body.skin_weights.argmax(-1)
        return self.body.skin_joints[np.arange(len(most)), most]

    def _joint(self, name: str) -> int:
        return self.body.joint_names.index(name)


def pose(forms: Sequence[Form], who: Index, translation: Array, rotations: Array) -> PosedBodies:
    """Frames of bodies of one gender: row r is of `forms[who[r]]`.

    who [R], translation [R, 3], rotations [R, 22, 4] (x, y, z, w).
    """
    used, form = np.unique(who, return_inverse=True)
    mine = [forms[number] for number in used]
    rest = np.stack([f.rest for f in mine])[form]
    local = matrix_from_quaternion(rotations.astype(np.float64))
    turns, places = mine[0].body.forward_kinematics(translation.astype(np.float64), local, rest)
    joints = mine[0].capsules.joints
    offsets = np.stack([f.capsules.offsets for f in mine])[form]
    ends = places[:, joints] + (turns[:, joints] @ offsets[..., None])[..., 0]
    radii = np.stack([f.capsules.radii for f in mine])[form]
    return PosedBodies(turns, places, ends[:, :, 0], ends[:, :, 1], radii)


def _bones() -> list[tuple[str, str, tuple[str, ...]]]:
    sides = [
        (f"{side}_{a}", f"{side}_{b}", tuple(f"{side}_{name}" for name in owners))
        for side in ("left", "right")
        for a, b, owners in LIMBS
    ]
    return [*TRUNK, (HEAD, HEAD, (HEAD,)), *sides]


def _from_line(points: Array, a: Array, b: Array) -> Array:
    """Distance of points [N, 3] from the line between two others. [N]"""
    along = b - a
    share = np.clip((points - a) @ along / max(float(along @ along), 1e-12), 0, 1)
    return np.linalg.norm(points - a - share[:, None] * along, axis=-1)
