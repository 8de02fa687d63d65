"""Motion as markers, of recorded clips and of streamed chunks."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.library import SHIPPED, load_body
from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.errors import InvalidArgument
from wayfarer.spec import GENDERS, MARKERS
from wayfarer_lab.evaluation.gait import Windows
from wayfarer_lab.evaluation.metrics.feet import runs
from wayfarer_lab.training.mocap.store import ClipRange, Dataset

Array = NDArray[np.floating[Any]]

BLOCK = 1024
"""Frames skinned at once: bounds memory."""


@dataclass(frozen=True)
class BodyTrack:
    """One body over T frames, world space, metres."""

    markers: Array  # [T, M, 3]
    hips: Array  # [T, 3]
    rotations: Array  # [T, 22, 4] local quaternions, joint 0 world

    def __getitem__(self, frames: slice) -> "BodyTrack":
        return BodyTrack(self.markers[frames], self.hips[frames], self.rotations[frames])

    def windows(self) -> Windows:
        """Whole windows of 1 s from its beginning."""
        return Windows.cut(self.markers, self.hips)


def skin_track(body: BodyModel, betas: Array, translation: Array, rotations: Array) -> BodyTrack:
    """Markers of a motion: betas [10], translation [T, 3], rotations [T, 22, 4] (x, y, z, w)."""
    rest = body.rest_joints(betas)
    markers = np.empty((len(translation), len(body.marker_names), 3), np.float32)
    for start in range(0, len(translation), BLOCK):
        frames = slice(start, start + BLOCK)
        local = matrix_from_quaternion(rotations[frames].astype(np.float64))
        world, places = body.forward_kinematics(translation[frames].astype(np.float64), local, rest)
        markers[frames] = body.markers(betas, world, places)
    return BodyTrack(markers, translation, rotations)


class Recorded:
    """The clips of one split of a prepared data folder, as recorded (no augmentation)."""

    def __init__(self, folder: Path, split: str) -> None:
        """Raises InvalidArgument when the split is empty, DataError for an unprepared folder."""
        self.data = Dataset.load(folder)
        self.bodies = {gender: load_body(SHIPPED, gender) for gender in GENDERS}
        self.clips = tuple(
            clip
            for clip in self.data.clips
            if clip.split == split and clip.augmentation == "" and clip.shape == "own"
        )
        if not self.clips:
            known = sorted({clip.split for clip in self.data.clips})
            raise InvalidArgument(
                f"{folder} has no clips as recorded in {split!r}; splits: {known}"
            )

    @property
    def once(self) -> tuple[ClipRange, ...]:
        """Every recording once: those on one gender's body, where a clip is prepared on both."""
        genders = {clip.gender for clip in self.clips}
        one = next(gender for gender in GENDERS if gender in genders)
        return tuple(clip for clip in self.clips if clip.gender == one)

    def track(self, clip: ClipRange) -> BodyTrack:
        """All frames of a clip."""
        frames = slice(clip.start, clip.stop)
        return skin_track(
            self.bodies[clip.gender],
            np.array(clip.betas),
            self.data.translation[frames],
            self.data.rotations[frames],
        )

    def windows(self, *uses: int) -> Windows:
        """All whole windows of 1 s in which every frame's `use` is one of `uses`; each second of
        the recordings once.
        """
        parts = [Windows.cut(np.zeros((0, MARKERS, 3)), np.zeros((0, 3)))]
        for clip in self.once:
            if runs := self.used(clip, *uses):
                track = self.track(clip)
                parts += [track[run].windows() for run in runs]
        return Windows.join(parts)

    def used(self, clip: ClipRange, *uses: int) -> list[slice]:
        """Runs of frames whose `use` is one of `uses`; slices count from the clip's start."""
        wanted = np.isin(self.data.use[clip.start : clip.stop], uses)
        return runs(wanted)
