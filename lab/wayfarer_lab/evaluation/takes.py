"""A take: some seconds of one body as a viewer sees them, made or recorded."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.body.skeleton import joint_names
from wayfarer.clips.clip import Clip
from wayfarer.spec import POSED_JOINTS
from wayfarer.world.agents.heading import facing_of
from wayfarer_lab.evaluation.metrics import feet, joints
from wayfarer_lab.evaluation.metrics.trunk import Trunk

Array = NDArray[np.floating[Any]]

JOINT: Final = {name: number for number, name in enumerate(joint_names()[:POSED_JOINTS])}
KNEES, ANKLES, BALLS, SHOULDERS, ELBOWS, WRISTS = (
    [JOINT[f"left_{part}"], JOINT[f"right_{part}"]]
    for part in ("knee", "ankle", "foot", "shoulder", "elbow", "wrist")
)
HEAD: Final = JOINT["head"]
LIMBS: Final = [*KNEES, *ANKLES, *BALLS, *ELBOWS, *WRISTS]


@dataclass(frozen=True)
class Take:
    """T frames of one body: world space, metres, Z up, 40 fps, flat floor at z = 0.

    `height` [T, 2] is that of the lowest point of each foot above the ground under it.
    """

    name: str
    person: str
    clip: Clip
    hips_height: float  # metres, hips of this body in the T-pose on the floor: its full height
    shins: Array  # [2, 3] knee to ankle in the T-pose
    joints: Array  # [T, 22, 3]
    turns: Array  # [T, 22, 3, 3] world rotations of the joints
    markers: Array  # [T, 67, 3] on the skin
    marker_names: tuple[str, ...]
    soles: Array  # [T, 2, 4, 3] those under the feet: heel, two balls, toe
    height: Array  # [T, 2]
    tilt: Array  # [T] degrees between the trunk and that of the T-pose, to any side
    forward: Array  # [T] degrees that the trunk leans forward of that

    @classmethod
    def of(cls, clip: Clip, body: BodyModel, name: str, person: str = "") -> "Take":
        """Pose and skin a clip on its body."""
        betas = np.asarray(clip.betas)
        turns, places = clip.pose(body)
        markers = body.markers(betas, turns, places)
        soles = markers[:, body.sole_markers].reshape(len(markers), 2, -1, 3)
        rest, trunk = body.rest_joints(betas), Trunk.of(body, betas)
        return cls(
            name=name,
            person=person or name,
            clip=clip,
            hips_height=float(rest[0, 2]),
            shins=rest[ANKLES] - rest[KNEES],
            joints=places[:, :POSED_JOINTS],
            turns=turns[:, :POSED_JOINTS],
            markers=markers.astype(np.float32),
            marker_names=body.marker_names,
            soles=soles,
            height=feet.heights(soles),
            tilt=trunk.tilt(markers),
            forward=trunk.forward(markers),
        )

    def __len__(self) -> int:
        return len(self.joints)

    def __getitem__(self, frames: slice) -> "Take":
        return replace(
            self,
            clip=self.clip[frames],
            joints=self.joints[frames],
            turns=self.turns[frames],
            markers=self.markers[frames],
            soles=self.soles[frames],
            height=self.height[frames],
            tilt=self.tilt[frames],
            forward=self.forward[frames],
        )

    @property
    def hips(self) -> Array:
        """[T, 3]"""
        return self.joints[:, 0]

    @property
    def ankles(self) -> Array:
        """[T, 2, 3]"""
        return self.joints[:, ANKLES]

    @property
    def contacts(self) -> NDArray[np.bool_]:
        """Contact flags of each foot, as sent. [T, 2]"""
        return self.clip.contacts

    @cached_property
    def facing(self) -> Array:
        """Horizontal unit vector that the hips face. [T, 2]"""
        return facing_of(self.clip.rotations[:, 0])

    @cached_property
    def heading(self) -> Array:
        """Heading of the hips, degrees about +Z, without jumps. [T]"""
        return np.degrees(np.unwrap(np.arctan2(-self.facing[:, 0], self.facing[:, 1])))

    @cached_property
    def stances(self) -> list[feet.Stance]:
        """Stances of both feet."""
        return feet.stances(self.soles, self.height)

    @cached_property
    def knees(self) -> Array:
        """Flexion of both knees, degrees. [T, 2]"""
        local = matrix_from_quaternion(np.asarray(self.clip.rotations[:, KNEES], np.float64))
        return joints.knee_flexion(local, self.shins)
