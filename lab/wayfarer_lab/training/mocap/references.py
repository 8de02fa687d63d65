"""Rest poses of files whose zero pose does not stand: a frame in which the person does.

Files with the same joints and bone lengths share their zero pose, so one standing frame serves
all of them, and a walk needs none itself.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.joints import joint_map
from wayfarer_lab.training.mocap.rig import leg_length
from wayfarer_lab.training.mocap.skeleton import MocapSkeleton, SkeletonMotion
from wayfarer_lab.training.mocap.stance import UP, RestFrame, standing_frame, stands

SAME_LENGTH = 0.01
"""Leg lengths by which joints of the same zero pose may differ between files."""


@dataclass
class _Rig:
    """Files of one zero pose, and the best standing frame seen in them, by upward axis."""

    skeleton: MocapSkeleton
    clips: list[str] = field(default_factory=list)
    found: dict[str, tuple[float, RestFrame]] = field(default_factory=dict)


class References:
    """The standing frames of a set of files; `chosen` is the user's `FRAME` or `CLIP:FRAME`."""

    def __init__(self, chosen: str = "", up: str | None = None) -> None:
        clip, _, frame = chosen.rpartition(":")
        if chosen and not frame.isdigit():
            raise DataError(f"--reference takes FRAME or CLIP:FRAME, got '{chosen}'")
        self._clip = clip
        self._frame = int(frame) if chosen else None
        self._axes = [up] if up else list(UP)
        self._rigs: list[_Rig] = []
        self._own: dict[str, RestFrame] = {}

    def add(self, clip: str, motion: SkeletonMotion) -> None:
        """Looks for a standing frame in a clip. Raises DataError if the chosen frame is not one."""
        rig = next((r for r in self._rigs if _alike(r.skeleton, motion.skeleton)), None)
        if rig is None:
            rig = _Rig(motion.skeleton)
            self._rigs.append(rig)
        rig.clips.append(clip)
        rows = joint_map(motion.skeleton)
        every, everywhere = motion.world()
        rotations, places = every[:, rows], everywhere[:, rows]
        if self._frame is not None:
            if self._clip in ("", clip):
                if self._frame >= len(motion):
                    raise DataError(f"--reference {self._frame}: it has {len(motion)} frames")
                frame = self._frame
                own = RestFrame(clip, frame, places[frame], rotations[frame])
                if not stands(own.places):
                    raise DataError(f"--reference: nobody stands upright in {own}")
                self._own[clip] = own
            return
        for axis in self._axes:
            best = standing_frame(places, axis, motion.fps or 1.0)
            if best is None:
                continue
            frame, off = best
            if axis not in rig.found or off < rig.found[axis][0]:
                rig.found[axis] = off, RestFrame(clip, frame, places[frame], rotations[frame])

    def find(self, clip: str, motion: SkeletonMotion) -> tuple[RestFrame, str | None]:
        """The rest pose for a clip, and the upward axis along which it was seen to stand.

        Raises DataError if there is none.
        """
        if self._frame is not None:
            own = self._own.get(self._clip or clip)
            if own is None:
                raise DataError(f"--reference: no clip {self._clip} whose zero pose does not stand")
            return own, None
        rig = next(r for r in self._rigs if _alike(r.skeleton, motion.skeleton))
        for axis in self._axes:  # y before z: who lies seems to stand along the other axis
            if axis in rig.found:
                return rig.found[axis][1], axis
        raise DataError(
            "the zero pose does not stand upright, and nobody stands still in "
            f"{_named(rig.clips)}: name a frame in which they do with --reference CLIP:FRAME"
        )

    def notes(self) -> list[str]:
        """The frames that were taken, a line for each zero pose."""
        found = []
        for rig in self._rigs:
            axis = next((a for a in self._axes if a in rig.found), None)
            if axis is not None:
                reference = rig.found[axis][1]
                found.append(
                    f"{_named(rig.clips)}: the zero pose does not stand; {reference}, in which "
                    f"the person stands ({axis} up), is the rest pose"
                )
        return found


def _alike(a: MocapSkeleton, b: MocapSkeleton) -> bool:
    if a.names != b.names or a.parents != b.parents:
        return False
    size = leg_length(a.rest_places()[joint_map(a)])
    return np.allclose(a.offsets[1:], b.offsets[1:], atol=SAME_LENGTH * size)


def _named(clips: Iterable[str]) -> str:
    names = list(dict.fromkeys(clips))
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
