"""Our 22 joints, and a recorded person's clips of them.

`SourceClip` is a motion in our conventions (metres, Z up, rest pose facing +Y, 40 fps), still
with the recorded person's proportions. Floor convention: z = 0 is the height of a standing
foot's ball joint, which the recording shows and its true sole does not.
"""

from dataclasses import dataclass, replace

import numpy as np

from wayfarer.body.skeleton import joint_names, mirrored, parents
from wayfarer.errors import DataError
from wayfarer.spec import POSED_JOINTS
from wayfarer_lab.training.mocap.skeleton import Array

JOINT_NAMES = joint_names()[:POSED_JOINTS]
J = {name: index for index, name in enumerate(JOINT_NAMES)}
PARENTS = np.array(parents()[:POSED_JOINTS])
MIRROR = np.array([J[mirrored(name)] for name in JOINT_NAMES])
METRES = (1.0, 0.01, 0.001, 0.0254, 0.0254 / 0.45)
"""Metres per unit that a file may use: m, cm, mm, inch, CMU's 1/0.45 inch."""
LEG = (0.6, 1.15)
"""Metres from hip to ankle that count as an adult's leg."""


def leg_length(places: Array) -> float:
    """Mean over both sides of thigh + shin, from joint places [22, 3]."""
    total = 0.0
    for side in ("left", "right"):
        hip, knee, ankle = (places[J[f"{side}_{part}"]] for part in ("hip", "knee", "ankle"))
        total += float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))
    return total / 2


def guess_unit(rest: Array) -> float:
    """Metres per file unit, from the length of the legs. Raises DataError if none fits."""
    leg = leg_length(rest)
    fitting = [m for m in METRES if LEG[0] <= leg * m <= LEG[1]]
    if len(fitting) != 1:
        raise DataError(f"cannot tell the length unit from a leg of {leg:.3g} units: give --unit")
    return fitting[0]


@dataclass(frozen=True)
class ClipInfo:
    """Metadata of a clip."""

    name: str
    source: str  # clip it was cut or derived from
    subject: str
    split: str = "train"
    category: str = ""
    locomotion: bool = True
    scene_contact: bool = False
    augmentation: str = ""


@dataclass(frozen=True)
class SourceClip:
    """Joints of a recorded person, 40 fps, metres, Z up; z = 0 at the standing ball of the foot."""

    info: ClipInfo
    places: Array  # [N, 22, 3]
    rotations: Array  # [N, 22, 3, 3] world, relative to `rest`
    rest: Array  # [22, 3] zero pose, facing +Y
    contacts: Array  # [N, 2, 2] bool: left, right foot × heel, ball

    def __len__(self) -> int:
        return len(self.places)

    def cut(self, start: int, stop: int, **info: object) -> "SourceClip":
        """Frames start..stop, with some fields of `info` replaced."""
        return replace(
            self,
            info=replace(self.info, **info),  # type: ignore[arg-type]
            places=self.places[start:stop],
            rotations=self.rotations[start:stop],
            contacts=self.contacts[start:stop],
        )
