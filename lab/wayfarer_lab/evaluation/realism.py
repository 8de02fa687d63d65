"""One row of realism for any motion, made or recorded: contact, smoothness, shape, likeness."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.errors import InvalidArgument
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer_lab.evaluation.gait import WINDOW_FRAMES, Row, Windows, gait_row
from wayfarer_lab.evaluation.metrics import contact, kinematics, prediction
from wayfarer_lab.evaluation.metrics.frechet import NAME as FRECHET
from wayfarer_lab.evaluation.metrics.frechet import Reference, features
from wayfarer_lab.evaluation.rollout import Rollout
from wayfarer_lab.evaluation.tracks import BodyTrack, Recorded
from wayfarer_lab.training.mocap.selection import Use

Array = NDArray[np.floating[Any]]

RIGID_PARTS: Final = {
    "head": ("LFHD", "RFHD", "LBHD", "RBHD"),
    "upper_torso": ("LSHO", "RSHO", "CLAV", "C7"),
    "lower_torso": ("LFWT", "RFWT", "LBWT", "RBWT"),
}
"""Markers that a rigid part carries (MOJO, Tab. 3)."""

HEELS: Final = ("LHEE", "RHEE")
"""Markers of MOJO's skating measure."""

SKATING: Final = {"heel_skating_75mm_s": 0.075, "heel_skating_200mm_s": 0.005 * FPS}
"""Name of the figure → limit, m/s. Both are 5 mm a frame: at MOJO's 15 fps, and at our 40."""


PoseScore = Callable[[Array], Array]
"""Rotations [T, 22, 4] of a motion → how usual each pose is [T], 0…1 (Eq. 8)."""


@dataclass(frozen=True)
class JudgedMotion:
    """Tracks measured together. A seam lies before each multiple of `seam_every` frames."""

    tracks: Sequence[BodyTrack]
    seam_every: int = NEW_FRAMES

    @classmethod
    def recorded(cls, recorded: Recorded, frames: int = WINDOW_FRAMES) -> "JudgedMotion":
        """Every stretch of recorded locomotion of at least `frames` frames in a split, once."""
        return cls([track for track, _ in recorded_tracks(recorded, frames)])

    def windows(self) -> Windows:
        """Whole windows of 5 primitives (about 1 s) of all tracks."""
        return Windows.join([Windows.cut(t.markers, t.hips, self.seam_every) for t in self.tracks])


def recorded_tracks(recorded: Recorded, frames: int) -> list[tuple[BodyTrack, str]]:
    """Every stretch of recorded locomotion of at least `frames` frames, once, with its performer.

    Raises InvalidArgument when there is none.
    """
    tracks = []
    for clip in recorded.once:
        runs = recorded.used(clip, Use.LOCOMOTION)
        if runs := [run for run in runs if run.stop - run.start >= frames]:
            whole = recorded.track(clip)
            tracks += [(whole[run], clip.subject) for run in runs]
    if not tracks:
        raise InvalidArgument(f"the split holds no stretch of {frames} frames of locomotion")
    return tracks


def realism_row(
    name: str,
    motion: JudgedMotion,
    body: BodyModel,
    reference: Reference | None = None,
    pose_score: PoseScore | None = None,
) -> Row:
    """All figures of `motion`; both genders have the same markers, so any `body` names them."""
    names, windows = body.marker_names, motion.windows()
    row: Row = {"name": name, "seconds": sum(len(t.hips) for t in motion.tracks) / FPS}
    row |= gait_row(name, windows, body.sole_markers)
    scores = [contact.paper_contact_of_clip(t.markers) for t in motion.tracks]
    for ending, share in (("q25", 25), ("median", 50), ("q75", 75)):
        row[f"contact_paper_{ending}"] = float(np.percentile(scores, share))
    row |= heel_skating(motion, names)
    for part, markers in rigid_parts(windows.markers, names).items():
        row[f"deformation_{part}_mm"] = 1000 * float(kinematics.deformation(markers).mean())
    if pose_score is not None:
        row["pose_prior"] = float(
            np.concatenate([pose_score(t.rotations) for t in motion.tracks]).mean()
        )
    if reference is not None:
        values = np.concatenate([features(t.markers, names) for t in motion.tracks])
        row[FRECHET] = reference.distance(values)
        row["frechet_windows"] = len(values)
    return row


def skating_row(name: str, motion: JudgedMotion, body: BodyModel) -> Row:
    """Only the figures of skating."""
    windows = motion.windows()
    feet = windows.markers[:, :, body.sole_markers]
    return {
        "name": name,
        "seconds": sum(len(t.hips) for t in motion.tracks) / FPS,
        "speed_mps": float(kinematics.travel_speed(windows.hips).mean()),
        **heel_skating(motion, body.marker_names),
        "both_feet_skating": float(contact.both_feet_skating(feet).mean()),
        "slide_cm_s": 100 * contact.slide_speed(feet),
        "contact_strict": float(contact.strict_contact(feet).mean()),
    }


def heel_skating(motion: JudgedMotion, names: Sequence[str]) -> Row:
    """Shares of steps in which both heels skate, by MOJO's limit and by 5 mm a frame."""
    heels = [names.index(heel) for heel in HEELS]
    shares: Row = {}
    for figure, limit in SKATING.items():
        skating = [contact.heel_skating(t.markers[:, heels], limit) for t in motion.tracks]
        shares[figure] = float(np.concatenate(skating).mean())
    return shares


def carried_figures(rollouts: Sequence[Rollout], names: Sequence[str]) -> Row:
    """Errors of the markers that primitives hand on, which are not exactly those of a body.

    `carried_error_mm`: mean distance from the body's own. `carried_deformation_mm`: deformation
    over whole motions, mean of the rigid parts.
    """
    carried = np.concatenate([r.carried for r in rollouts])
    if not len(carried):
        return {}
    error = prediction.amd(carried, np.concatenate([r.reprojected() for r in rollouts]))
    parts = rigid_parts(carried.reshape(len(carried), -1, *carried.shape[3:]), names)
    deformed = [kinematics.deformation(markers).mean() for markers in parts.values()]
    return {
        "carried_error_mm": error,
        "carried_deformation_mm": 1000 * float(np.mean(deformed)),
    }


def rigid_parts(markers: Array, names: Sequence[str]) -> dict[str, Array]:
    """Markers [..., T, P, 3] of each rigid part, of markers [..., T, M, 3] called `names`."""
    return {
        part: markers[..., [names.index(name) for name in group], :]
        for part, group in RIGID_PARTS.items()
    }
