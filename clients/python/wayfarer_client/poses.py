"""Packed frames → numpy arrays; docs/wire-format.md shows the layout byte by byte."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from wayfarer_client.bases import BASES, Basis
from wayfarer_client.errors import WayfarerError
from wayfarer_client.gait import BONES, Gait, Roots
from wayfarer_client.messages import PoseFormat, enum_label
from wayfarer_client.v1 import catalog_pb2, common_pb2, motion_pb2

ROTATION_TYPES: Final = {
    motion_pb2.POSE_ENCODING_F32_LE: np.dtype(("<f4", 4)),
    motion_pb2.POSE_ENCODING_SMALLEST_THREE: np.dtype(("<u2", 3)),
}
MAX_BONES: Final = 52
MIDDLE: Final = 16383
STEP: Final = 1 / (MIDDLE * 2**0.5)
OTHERS: Final = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
"""Maps the omitted component to the three that are sent."""


class Unpacked(NamedTuple):
    """Frames of chunks, one chunk after the other."""

    translation: NDArray[np.float32]  # [F, 3] hips
    rotations: NDArray[np.float32]  # [F, B, 4] x, y, z, w


class PoseLayout:
    """Packing of a stream's poses, from its header or one of its tiers."""

    def __init__(self, header: motion_pb2.StreamHeader | motion_pb2.Tier) -> None:
        """Raises WayfarerError when this client cannot read the poses."""
        if isinstance(header, motion_pb2.Tier):
            fields = ("pose_encoding", "sent_fps", "bones")
            header = motion_pb2.StreamHeader(**{name: getattr(header, name) for name in fields})
        self.encoding = header.pose_encoding
        self.fps = header.sent_fps or header.fps
        self.bones = tuple(header.bones) or tuple(range(header.skeleton.posed_bones))
        rotation = ROTATION_TYPES.get(self.encoding)
        if rotation is None:
            raise WayfarerError(
                f"server {header.server_version} sends pose encoding {self.encoding}, "
                "which this client does not know: update wayfarer-client"
            )
        self._frame = np.dtype(
            [("translation", "<f4", (3,)), ("rotations", rotation, (len(self.bones),))]
        )

    @classmethod
    def of(cls, format: PoseFormat, skeleton: catalog_pb2.Skeleton) -> Self:
        """The layout of a reply without a header, as requested."""
        names = [bone.name for bone in skeleton.bones]
        count = {"body": skeleton.posed_bones, "full": len(names)}.get(format.profile)
        chosen = range(count) if count else sorted(map(names.index, format.bones))
        encoding = enum_label(motion_pb2.PoseEncoding, format.encoding, "encoding")
        return cls(
            motion_pb2.StreamHeader(pose_encoding=encoding, sent_fps=format.fps, bones=chosen)
        )

    def unpack(self, poses: bytes) -> Unpacked:
        """`MotionChunks.poses` as arrays. Raises WayfarerError when these are not whole frames."""
        if len(poses) % self._frame.itemsize:
            raise WayfarerError(
                f"{len(poses)} bytes of poses are not whole frames of {self._frame.itemsize} bytes"
            )
        frames = np.frombuffer(poses, self._frame)
        return Unpacked(frames["translation"], self._rotations(frames["rotations"]))

    def _rotations(self, packed: NDArray[Any]) -> NDArray[np.float32]:
        if self.encoding == motion_pb2.POSE_ENCODING_F32_LE:
            return packed
        return unpack_smallest_three(packed)


class RootLayout:
    """Frames without rotations, of the encoding ROOT."""

    FRAME: Final = np.dtype(
        [("translation", "<f4", (3,)), ("heading", "<i2"), ("phase", "u1"), ("swing", "u1")]
    )

    def __init__(self, fps: int) -> None:
        self.fps = fps

    def read(self, poses: bytes) -> Roots:
        """`MotionChunks.poses` as numbers. Raises WayfarerError when these are not whole frames."""
        if len(poses) % self.FRAME.itemsize:
            raise WayfarerError(
                f"{len(poses)} bytes of poses are not whole frames of {self.FRAME.itemsize} bytes"
            )
        frames = np.frombuffer(poses, self.FRAME)
        return Roots(
            frames["translation"],
            frames["heading"] * (np.pi / 32768),
            frames["phase"] / 256,
            frames["swing"] / 128,
        )


class TierLayout:
    """The poses of one tier, unpacked into the bones of the first."""

    def __init__(
        self,
        packed: PoseLayout | RootLayout,
        bones: Sequence[int],
        basis: Basis,
    ) -> None:
        self.fps = packed.fps
        self._packed = packed
        self._bones = np.array(bones, int)
        self._gait = Gait(basis)

    def unpack(self, poses: bytes) -> Unpacked:
        """`MotionChunks.poses` as arrays. Raises WayfarerError when these are not whole frames."""
        if isinstance(self._packed, RootLayout):
            roots = self._packed.read(poses)
            each = zip(roots.heading, roots.phase, roots.swing, strict=True)
            whole = self._whole(len(roots.phase))
            for frame, (heading, phase, swing) in zip(whole, each, strict=True):
                frame[:BONES] = self._gait.pose(heading, phase, swing)
            return Unpacked(roots.translation, whole[:, self._bones])
        found = self._packed.unpack(poses)
        whole = self._whole(len(found.translation))
        whole[:, list(self._packed.bones)] = found.rotations
        return Unpacked(found.translation, whole[:, self._bones])

    def _whole(self, frames: int) -> NDArray[np.float32]:
        """All bones, standing; fingers at rest [F, 52, 4]."""
        whole = np.zeros((frames, MAX_BONES, 4), np.float32)
        whole[..., 3] = 1.0
        whole[:, :BONES] = self._gait.stand
        return whole


Layout = PoseLayout | TierLayout


def layouts_of(header: motion_pb2.StreamHeader) -> tuple[tuple[int, ...], list[Layout]]:
    """The bones of the poses that a stream gives, and how to unpack each of its tiers.

    Raises WayfarerError when this client cannot read the poses.
    """
    roots = motion_pb2.POSE_ENCODING_ROOT
    tiers: list[Any] = list(header.tiers) or [header]
    is_plain = tiers[0].pose_encoding != roots
    first = PoseLayout(header) if is_plain else None
    bones = first.bones if first else tuple(range(header.skeleton.posed_bones or BONES))
    if any(bone >= MAX_BONES for tier in tiers for bone in tier.bones):
        raise WayfarerError(f"the server sends bones beyond the {MAX_BONES} of this client")
    basis = BASES[_basis_name(header.basis)]
    found: list[Layout] = []
    for tier in tiers:
        if tier.pose_encoding == roots:
            found.append(TierLayout(RootLayout(tier.sent_fps), bones, basis))
        elif first is not None and list(tier.bones) in ([], list(bones)):
            found.append(first if tier is tiers[0] else PoseLayout(tier))
        else:
            found.append(TierLayout(PoseLayout(tier), bones, basis))
    return bones, found


def _basis_name(basis: common_pb2.BasisInfo) -> str:
    names = {
        number: name.removeprefix("BASIS_").lower() for name, number in common_pb2.Basis.items()
    }
    return names[basis.basis] if names.get(basis.basis) in BASES else "gltf"


def unpack_smallest_three(words: NDArray[np.uint16]) -> NDArray[np.float32]:
    """Three words per rotation [..., 3] → quaternions x, y, z, w [..., 4]."""
    flat = words.reshape(-1, 3)
    left_out = (flat[:, 0] >> 15) | (flat[:, 1] >> 15 << 1)
    others = ((flat & 0x7FFF).astype(np.float64) - MIDDLE) * STEP
    rows = np.arange(len(flat))
    quaternions = np.empty((len(flat), 4))
    quaternions[rows[:, None], OTHERS[left_out]] = others
    squares = (others**2).sum(axis=1)
    quaternions[rows, left_out] = np.sqrt(np.maximum(0.0, 1.0 - squares))
    return quaternions.astype(np.float32).reshape(*words.shape[:-1], 4)
