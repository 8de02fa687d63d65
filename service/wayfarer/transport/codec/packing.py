"""Chunks of the runtime ↔ packed frames."""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.spec import POSED_JOINTS
from wayfarer.transport.basis import Axes, Basis
from wayfarer.transport.codec import smallest_three
from wayfarer.transport.codec.pose_format import PoseEncoding, PoseFormat
from wayfarer.world.agents.agent import MotionChunks

FOOT_BITS: Final = np.array([1, 2], np.uint8)
"""Left, right."""

BLOCK: Final = 128
"""Chunks packed at once: what is read and made on the way stays in the processor's cache."""

AT_REST: Final = np.array([0.0, 0.0, 0.0, 1.0], np.float32)
"""The same in every basis."""


class PackedPoses(NamedTuple):
    """The frames of chunks, one chunk after the other, as they go on the wire."""

    poses: memoryview
    contacts: bytes


class DecodedPoses(NamedTuple):
    """Frames in the core basis: metres, Z up."""

    translation: NDArray[np.float32]  # [F, 3]
    rotations: NDArray[np.float32]  # [F, B, 4] of the bones of the format, unit length
    contacts: NDArray[np.bool_]  # [F, 2] left, right


def encode(
    chunks: MotionChunks, basis: Basis, pose_format: PoseFormat = PoseFormat()
) -> PackedPoses:
    """Pack chunks into the basis and the format.

    Each begins with a frame whose number is a multiple of `spec.NEW_FRAMES`, and so of the stride
    of every format: what is sent stays evenly spaced from chunk to chunk.
    """
    stride = pose_format.stride
    translation, rotations = chunks.translation[:, ::stride], chunks.rotations[:, ::stride]
    packed = np.empty(translation.shape[:2], pose_format.frame)
    for start in range(0, len(chunks), BLOCK):
        block = slice(start, start + BLOCK)
        basis.axes.points_to_wire(translation[block], out=packed["translation"][block])
        _pack(rotations[block], basis.axes, pose_format, packed["rotations"][block])
    contacts = (chunks.contacts[:, ::stride] * FOOT_BITS).sum(-1, dtype=np.uint8)
    return PackedPoses(packed.reshape(-1).view(np.uint8).data, contacts.tobytes())


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


def _pack(
    rotations: NDArray[np.float32], axes: Axes, pose_format: PoseFormat, out: NDArray[Any]
) -> None:
    """Rotations [A, F, 22, 4] into those of frames [A, F, B, …]."""
    posed = pose_format.posed
    if len(posed) < POSED_JOINTS:
        rotations = rotations[:, :, posed]
    moving, still = out[:, :, : len(posed)], out[:, :, len(posed) :]
    if pose_format.encoding is PoseEncoding.SMALLEST_THREE:
        moving[:] = smallest_three.pack(axes.quaternions_to_wire(rotations))
        still[:] = smallest_three.pack(AT_REST)
    else:
        axes.quaternions_to_wire(rotations, out=moving)
        still[:] = AT_REST  # fingers


def _unpack(rotations: NDArray[Any], encoding: PoseEncoding) -> NDArray[np.float32]:
    if encoding is PoseEncoding.SMALLEST_THREE:
        return smallest_three.unpack(rotations)
    return rotations.astype(np.float32)
