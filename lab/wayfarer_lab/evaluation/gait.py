"""One row of gait figures for any motion, made or recorded, by the same code."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.errors import InvalidArgument
from wayfarer.spec import NEW_FRAMES
from wayfarer_lab.evaluation.metrics import contact, kinematics
from wayfarer_lab.evaluation.metrics.trunk import Trunk

Array = NDArray[np.floating[Any]]
Row = dict[str, float | int | str]

WINDOW_STEPS: Final = 5
"""Primitives in a window, so that seams keep their places: 1 s with 8 new frames in each."""

WINDOW_FRAMES: Final = WINDOW_STEPS * NEW_FRAMES


@dataclass(frozen=True)
class Windows:
    """Equal pieces of motion, world space: W windows of T frames."""

    markers: Array  # [W, T, M, 3]
    hips: Array  # [W, T, 3]
    seam_every: int = NEW_FRAMES  # new frames of a primitive; a seam lies before the first frame

    @classmethod
    def cut(cls, markers: Array, hips: Array, seam_every: int = NEW_FRAMES) -> "Windows":
        """Cut one track, markers [T, M, 3] and hips [T, 3], into whole windows of 5 primitives."""
        frames = WINDOW_STEPS * seam_every
        return cls(
            kinematics.windows(markers, frames), kinematics.windows(hips, frames), seam_every
        )

    @classmethod
    def join(cls, parts: "list[Windows]") -> "Windows":
        """All windows of several tracks. Raises InvalidArgument when there is no track."""
        if not parts:
            raise InvalidArgument("no motion to cut into windows")
        return cls(
            np.concatenate([p.markers for p in parts]),
            np.concatenate([p.hips for p in parts]),
            parts[0].seam_every,
        )

    def at_walking_speed(self) -> "Windows":
        """Windows at 0.9 … 1.4 m/s: contact falls with speed, so only equal speeds are compared."""
        chosen = kinematics.at_walking_speed(self.hips)
        return Windows(self.markers[chosen], self.hips[chosen], self.seam_every)


def gait_row(name: str, motion: Windows, soles: NDArray[np.int64]) -> Row:
    """All gait figures of `motion`; `soles` are the marker indices under the feet, left first."""
    if not len(motion.markers):
        return {"name": name, "windows": 0}
    feet = motion.markers[:, :, soles]
    depth = contact.penetration(motion.markers)
    return {
        "name": name,
        "windows": len(motion.markers),
        "speed_mps": float(kinematics.travel_speed(motion.hips).mean()),
        "contact_paper": float(contact.paper_contact_of_clip(motion.markers).mean()),
        "contact_strict": float(contact.strict_contact(feet).mean()),
        "slide_cm_s": 100 * contact.slide_speed(feet),
        "both_feet_skating": float(contact.both_feet_skating(feet).mean()),
        "penetration_cm": 100 * float(depth.mean()),
        "deeper_3cm": float((depth > contact.DEEP).mean()),
        "floating_5cm": float((contact.clearance(motion.markers) > contact.FLOATING).mean()),
        "acceleration_m_s2": float(kinematics.acceleration(motion.markers).mean()),
        "jerk_m_s3": float(kinematics.jerk(motion.markers).mean()),
        "seam_ratio": kinematics.seam_ratio(motion.markers, every=motion.seam_every),
    }


def stillness_row(name: str, motion: Windows) -> Row:
    """How much a standing body moves: over all markers and frames. Trembling shows as
    acceleration without speed.
    """
    if not len(motion.markers):
        return {"name": name, "windows": 0}
    speed = np.linalg.norm(kinematics.velocity(motion.markers), axis=-1)
    return {
        "name": name,
        "windows": len(motion.markers),
        "marker_speed_cm_s": 100 * float(speed.mean()),
        "acceleration_m_s2": float(kinematics.acceleration(motion.markers).mean()),
        "jerk_m_s3": float(kinematics.jerk(motion.markers).mean()),
    }


def lean(row: Row, motion: Windows, trunk: Trunk) -> Row:
    """`row` with the mean tilt of the trunk, degrees, in the motion that it describes."""
    if not len(motion.markers):
        return row
    return {**row, "trunk_tilt_deg": float(trunk.tilt(motion.markers).mean())}


def posed_gait_rows(name: str, motion: Windows, body: BodyModel) -> list[Row]:
    """Rows of all windows and of those at walking speed; both genders have the same markers."""
    trunk = Trunk.of(body)
    matched = motion.at_walking_speed()
    return [
        lean(gait_row(name, motion, body.sole_markers), motion, trunk),
        lean(gait_row(f"{name}, 0.9-1.4 m/s", matched, body.sole_markers), matched, trunk),
    ]
