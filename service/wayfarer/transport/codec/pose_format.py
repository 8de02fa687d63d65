"""The contents and packing of poses: the choices of a stream, clip or lock-step call."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.skeleton import load_skeleton
from wayfarer.errors import InvalidArgument
from wayfarer.runtime.streams.root_tracks import ROOT_FPS
from wayfarer.spec import FPS, JOINTS, POSED_JOINTS
from wayfarer.transport.codec.root import ROOT_FRAME

RATES: Final = (FPS, FPS // 2, FPS // 4)
"""Frame rates that can be chosen; every, every second or every fourth frame is sent."""

SHOWN_NAMES: Final = 8
"""Maximum number of wrong names that an error repeats."""


class PoseEncoding(StrEnum):
    """How the numbers of a frame are packed; names as in motion.proto."""

    F32_LE = "f32_le"
    SMALLEST_THREE = "smallest_three"
    ROOT = "root"

    @property
    def rotation_type(self) -> np.dtype[Any]:
        """Type of one rotation: four floats, or three words of smallest_three.py; ROOT has none."""
        return ROTATION_TYPES[self]


ROTATION_TYPES: Final = {
    PoseEncoding.F32_LE: np.dtype(("<f4", 4)),
    PoseEncoding.SMALLEST_THREE: np.dtype(("<u2", 3)),
}


class PoseProfile(StrEnum):
    """Which bones have a rotation in every frame."""

    BODY = "body"
    FULL = "full"
    BONES = "bones"


@dataclass(frozen=True)
class PoseFormat:
    """A checked choice of encoding, bones and frame rate. Hashable."""

    encoding: PoseEncoding = PoseEncoding.F32_LE
    bones: tuple[int, ...] = tuple(range(POSED_JOINTS))  # indices into the skeleton, ascending
    fps: int = FPS

    @classmethod
    def choose(
        cls,
        encoding: PoseEncoding = PoseEncoding.F32_LE,
        profile: PoseProfile = PoseProfile.BODY,
        bones: Sequence[str] = (),
        fps: int = 0,
        field: str = "",
    ) -> Self:
        """The format that a client asks for; `fps` 0 is the full rate.

        Raises InvalidArgument that names the part at fault below `field`.
        """
        path = f"{field}." if field else ""
        if encoding is PoseEncoding.ROOT:
            return cls._root(profile, bones, fps, path)
        if fps not in (0, *RATES):
            allowed = ", ".join(map(str, RATES))
            raise InvalidArgument(f"{fps} is none of {allowed} frames per second", f"{path}fps")
        return cls(encoding, _indices(profile, bones, f"{path}bones"), fps or FPS)

    @classmethod
    def _root(cls, profile: PoseProfile, bones: Sequence[str], fps: int, path: str) -> Self:
        """Raises InvalidArgument."""
        if profile is not PoseProfile.BODY or bones:
            at = f"{path}bones" if bones else f"{path}profile"
            raise InvalidArgument("the encoding ROOT has no bones: leave out profile and bones", at)
        if fps not in (0, ROOT_FPS):
            raise InvalidArgument(
                f"the encoding ROOT has {ROOT_FPS} frames per second", f"{path}fps"
            )
        return cls(PoseEncoding.ROOT, (), ROOT_FPS)

    @property
    def stride(self) -> int:
        """Stride of the frames that are sent: 1, 2 or 4."""
        return FPS // self.fps

    @cached_property
    def frame(self) -> np.dtype[Any]:
        """One frame as packed bytes: `translation` and `rotations`, or those of root.py."""
        if self.encoding is PoseEncoding.ROOT:
            return ROOT_FRAME
        rotations = (self.encoding.rotation_type, (len(self.bones),))
        return np.dtype([("translation", "<f4", (3,)), ("rotations", *rotations)])

    @property
    def frame_bytes(self) -> int:
        """Size of one frame."""
        return self.frame.itemsize

    @cached_property
    def posed(self) -> NDArray[np.intp]:
        """The bones that move, which come first in `bones`: fingers stay at rest."""
        return np.array([bone for bone in self.bones if bone < POSED_JOINTS], np.intp)

    def header(self) -> dict[str, Any]:
        """The fields of StreamHeader that describe this format."""
        return {
            "pose_encoding": f"POSE_ENCODING_{self.encoding.name}",
            "sent_fps": self.fps,
            "bones": self.bones,
            "frame_bytes": self.frame_bytes,
        }


def _indices(profile: PoseProfile, names: Sequence[str], field: str) -> tuple[int, ...]:
    """Bones of a profile. Raises InvalidArgument."""
    if profile is not PoseProfile.BONES:
        if names:
            raise InvalidArgument("bones are named with the profile BONES only", field)
        return tuple(range(POSED_JOINTS if profile is PoseProfile.BODY else JOINTS))
    if not names:
        raise InvalidArgument("the profile BONES needs the name of one bone at least", field)
    if len(names) > JOINTS:
        raise InvalidArgument(f"{JOINTS} bones at most, not {len(names)}", field)
    known = {bone.name: index for index, bone in enumerate(load_skeleton())}
    if unknown := [name[:32] for name in names if name not in known]:
        shown = ", ".join(map(repr, unknown[:SHOWN_NAMES]))
        more = f" and {len(unknown) - SHOWN_NAMES} more" if len(unknown) > SHOWN_NAMES else ""
        raise InvalidArgument(f"no bones {shown}{more}; the skeleton has {', '.join(known)}", field)
    if len(set(names)) < len(names):
        twice = next(name for name in names if list(names).count(name) > 1)
        raise InvalidArgument(f"{twice!r} is named twice", field)
    return tuple(sorted(known[name] for name in names))
