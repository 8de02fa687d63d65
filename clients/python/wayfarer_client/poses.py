"""Packed frames → numpy arrays; docs/wire-format.md shows the layout byte by byte."""

from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from wayfarer_client.errors import WayfarerError
from wayfarer_client.messages import PoseFormat, enum_label
from wayfarer_client.v1 import catalog_pb2, motion_pb2

ROTATION_TYPES: Final = {
    motion_pb2.POSE_ENCODING_F32_LE: np.dtype(("<f4", 4)),
    motion_pb2.POSE_ENCODING_F16_LE: np.dtype(("<f2", 4)),
    motion_pb2.POSE_ENCODING_SMALLEST_THREE: np.dtype(("<u2", 3)),
}
MIDDLE: Final = 16383
STEP: Final = 1 / (MIDDLE * 2**0.5)
OTHERS: Final = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
"""[component left out] → the three that are sent."""


class Unpacked(NamedTuple):
    """Frames of chunks, one chunk after the other."""

    translation: NDArray[np.float32]  # [F, 3] hips
    rotations: NDArray[np.float32]  # [F, B, 4] x, y, z, w


class PoseLayout:
    """How the poses of a stream are packed: what its header says."""

    def __init__(self, header: motion_pb2.StreamHeader) -> None:
        """Raises WayfarerError when this client cannot read the poses."""
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
    def of(cls, wanted: PoseFormat, skeleton: catalog_pb2.Skeleton) -> Self:
        """The layout of a reply that has no header: as asked for."""
        names = [bone.name for bone in skeleton.bones]
        count = {"body": skeleton.posed_bones, "full": len(names)}.get(wanted.profile)
        chosen = range(count) if count else sorted(map(names.index, wanted.bones))
        encoding = enum_label(motion_pb2.PoseEncoding, wanted.encoding, "encoding")
        return cls(
            motion_pb2.StreamHeader(pose_encoding=encoding, sent_fps=wanted.fps, bones=chosen)
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
        if self.encoding == motion_pb2.POSE_ENCODING_SMALLEST_THREE:
            return unpack_smallest_three(packed)
        wide = packed.astype(np.float32)
        length = np.linalg.norm(wide, axis=-1, keepdims=True)
        return np.asarray(wide / length, np.float32)


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
