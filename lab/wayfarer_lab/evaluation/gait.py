"""One row of gait figures for any motion, made or recorded, by the same code."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.spec import NEW_FRAMES
from wayfarer_lab.evaluation.metrics import contact, kinematics
from wayfarer_lab.evaluation.metrics.trunk import Trunk

Array = NDArray[np.floating[Any]]
Row = dict[str, float | int | str]

MOCAP: Final = "mocap"
"""Name of the row of recorded motion; rows of a part of it begin with it."""

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
        """Cuts one track, markers [T, M, 3] and hips [T, 3], into whole windows of 5 primitives."""
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
    """All gait figures of `motion`; `soles` are the marker indices under the feet, left first.

    World space, Z up, floor at z = 0, metres, 40 fps. The 67 markers are skinned from the streamed
    body parameters, for models and recordings alike; rows *mocap* are recorded *locomotion*.
    *Soles* are the four markers under each foot. A figure is a mean over frames and windows unless
    it says otherwise. *Windows* are 5 primitives long (1 s) and do not overlap. Rows `…, 0.9-1.4
    m/s` hold only windows at walking speed: contact falls with speed, so compare like with like.

    Figures:
        windows: number of windows
        motions: number of motions
        runs: number of runs
        agents: number of agents
        seconds: length of each motion
        speed_mps: horizontal speed of the hips, from positions 10 frames apart
        contact_paper*: Eq. 11 for each 10 frames: exp(−(min|z| − .05)₊) · exp(−(min speed −
            .075)₊), minima over all markers and frames. One slow low marker is enough, so it
            saturates. `_q25 _median _q75` are over motions, as the boxes of Fig. 3
        contact_strict: Eq. 11 for each frame, soles only
        slide_cm_s: median horizontal speed of the lowest sole marker while below 3 cm
        both_feet_skating: share of frames in which the lowest sole marker of *both* feet is within
            5 cm of the floor and faster than 0.15 m/s horizontally (PRIMAL, at 30 fps)
        heel_skating_75mm_s: MOJO's measure: share of frames in which both heel markers (LHEE, RHEE)
            are within 5 cm of the floor and have moved faster than 75 mm/s horizontally since the
            last frame; MOJO's limit is 5 mm a frame at 15 fps
        heel_skating_200mm_s: the same with 200 mm/s: 5 mm a frame at our 40 fps
        penetration_cm: mean depth of the lowest marker below the floor
        deeper_3cm: share of frames in which the lowest marker is deeper than 3 cm
        floating_5cm: share of frames whose lowest marker is above 5 cm (flight phases of runs
            count)
        acceleration_m_s2: mean norm of second differences, all markers
        jerk_m_s3: mean norm of third differences, all markers
        seam_ratio: mean acceleration at the frames on both sides of a primitive's seam ÷ elsewhere;
            1: no seam shows
        deformation_*_mm: sum over pairs of a rigid part's four markers of the standard deviation of
            their distance in a window (MOJO; Tab. S3). Skin is soft: the torso of recordings
            deforms too
        carried_error_mm: distance of the markers that a primitive hands to the next one from the
            body's own markers
        carried_deformation_mm: deformation of those markers over the whole motion, mean of the
            parts
        lost: share of motions that did not stay bodies (not finite, or a marker over 3 m from the
            hips); the other figures leave them out
        auc: in place of the paper's users: how often a linear classifier ranks a recorded window of
            2 s (train split, 0.9–1.5 m/s, as many and as fast) above one of these; 0.5: it sees no
            difference. NaN with fewer than 40 windows
        auc_windows: windows of each kind that were compared
        pose_prior: how usual the poses are to the pose prior: exp(−|μ|² / 32), mean over frames,
            0…1 (Eq. 8 with a scale, docs/models.md)
        frechet_v1: Fréchet distance from the recorded locomotion of the *train* split, on 37
            statistics of 2 s windows: velocities and heights of hips, head, hands and feet in the
            body's heading, turning speed, coordination (`evaluation/metrics/frechet.py`). Other
            people's walking is far from 0 (26 to 214 for one subject against the others of our
            train split), so read it against the row mocap. Few windows raise it: 196 drawn from the
            reference itself gave 1.5
        frechet_windows: number of windows for `frechet_v1`
        trunk_tilt_deg: angle of the trunk (waist to chest) from that of the T-pose
    """
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


def lean(row: Row, motion: Windows, trunk: Trunk) -> Row:
    """`row` with the mean tilt of the trunk, degrees, in the motion that it describes."""
    if not len(motion.markers):
        return row
    return {**row, "trunk_tilt_deg": float(trunk.tilt(motion.markers).mean())}
