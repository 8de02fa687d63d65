"""Chunks of the runtime ↔ packed frames."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.runtime.agent import MotionChunk
from wayfarer.spec import POSED_JOINTS
from wayfarer.transport.basis import Basis
from wayfarer.transport.codec import smallest_three
from wayfarer.transport.codec.pose_format import PoseEncoding, PoseFormat

FOOT_BITS: Final = np.array([1, 2])
"""Left, right."""

BLOCK: Final = 128
"""Chunks packed at once: what numpy makes on the way stays in the processor's cache."""

AT_REST: Final = np.array([0.0, 0.0, 0.0, 1.0], np.float32)
"""The same in every basis."""


class Poses(NamedTuple):
    """The frames of one chunk as they go on the wire."""

    poses: bytes
    contacts: bytes
    skipped: int = 0
    """Frames of the chunk before the first that is sent: `MotionChunk.first_frame` grows by it."""


class DecodedPoses(NamedTuple):
    """Frames in the core basis: metres, Z up."""

    translation: NDArray[np.float32]  # [F, 3]
    rotations: NDArray[np.float32]  # [F, B, 4] of the bones of the format, unit length
    contacts: NDArray[np.bool_]  # [F, 2] left, right


def encode(
    chunks: Sequence[MotionChunk], basis: Basis, pose_format: PoseFormat = PoseFormat()
) -> list[Poses]:
    """Pack chunks, all at once, into the basis and the format.

    Those frames are sent whose number, counted since the agent began, is a multiple of
    the stride of the format, so that they stay evenly spaced from chunk to chunk.
    """
    return [
        poses
        for start in range(0, len(chunks), BLOCK)
        for poses in _encode_block(chunks[start : start + BLOCK], basis, pose_format)
    ]


def _encode_block(
    chunks: Sequence[MotionChunk], basis: Basis, pose_format: PoseFormat
) -> list[Poses]:
    stride = pose_format.stride
    skipped = [-chunk.first_frame % stride for chunk in chunks]
    starts = list(zip(chunks, skipped, strict=True))
    translation = np.concatenate([c.translation[k::stride] for c, k in starts])
    rotations = np.concatenate([c.rotations[k::stride] for c, k in starts])
    contacts = np.concatenate([c.contacts[k::stride] for c, k in starts])
    packed = np.empty(len(translation), pose_format.frame)
    packed["translation"] = basis.axes.points_to_wire(translation)
    posed = pose_format.posed
    if len(posed) < POSED_JOINTS:
        rotations = rotations[:, posed]
    turned = basis.axes.quaternions_to_wire(rotations)
    packed["rotations"][:, : len(posed)] = _pack(turned, pose_format.encoding)
    packed["rotations"][:, len(posed) :] = _pack(AT_REST, pose_format.encoding)  # fingers
    touching = (contacts @ FOOT_BITS).astype(np.uint8)
    ends = np.cumsum([len(range(k, len(c.translation), stride)) for c, k in starts])
    return [
        Poses(packed[a:b].tobytes(), touching[a:b].tobytes(), k)
        for a, b, k in zip([0, *ends[:-1]], ends, skipped, strict=True)
    ]


def decode(
    poses: bytes, contacts: bytes, basis: Basis, pose_format: PoseFormat = PoseFormat()
) -> DecodedPoses:
    """The inverse of `encode` for one chunk. Raises InvalidArgument where lengths do not fit."""
    if len(poses) != pose_format.frame_bytes * len(contacts):
        raise InvalidArgument(
            f"{len(poses)} bytes of poses for {len(contacts)} frames of "
            f"{pose_format.frame_bytes} bytes",
            "poses",
        )
    packed = np.frombuffer(poses, pose_format.frame)
    rotations = basis.axes.quaternions_to_core(_unpack(packed["rotations"], pose_format.encoding))
    bits = np.frombuffer(contacts, np.uint8)
    return DecodedPoses(
        basis.axes.points_to_core(packed["translation"]),
        rotations,
        (bits[:, None] & FOOT_BITS).astype(bool),
    )


def _pack(rotations: NDArray[np.float32], encoding: PoseEncoding) -> NDArray[Any]:
    if encoding is PoseEncoding.SMALLEST_THREE:
        return smallest_three.pack(rotations)
    return rotations  # numpy rounds to the type of the frame


def _unpack(rotations: NDArray[Any], encoding: PoseEncoding) -> NDArray[np.float32]:
    if encoding is PoseEncoding.SMALLEST_THREE:
        return smallest_three.unpack(rotations)
    if encoding is PoseEncoding.F32_LE:
        return rotations.astype(np.float32)
    wide = rotations.astype(np.float32)
    return wide / np.linalg.norm(wide, axis=-1, keepdims=True)
