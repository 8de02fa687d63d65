"""Chunks of the runtime → packed frames."""

from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.process.compiled import compiled, warm
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS
from wayfarer.transport.codec.pose_format import PoseEncoding, PoseFormat
from wayfarer.transport.codec.smallest_three import pack_one
from wayfarer.transport.conversion.basis import Basis
from wayfarer.world.agents.agent import MotionChunks

FOOT_BITS: Final = np.array([1, 2], np.uint8)
"""Left, right."""

Float = NDArray[np.float32]
Words = NDArray[np.uint16]
Index = NDArray[np.int64]


class PackedPoses(NamedTuple):
    """The packed frames of chunks, one chunk after the other."""

    poses: memoryview
    contacts: bytes


def encode(
    chunks: MotionChunks, basis: Basis, pose_format: PoseFormat = PoseFormat()
) -> PackedPoses:
    """Packs chunks in the basis and the format.

    Each chunk begins with a frame whose number is a multiple of `spec.NEW_FRAMES`, and therefore of
    the stride of every format. So the frames sent are evenly spaced across chunks.
    """
    stride, axes = pose_format.stride, basis.axes
    translation = chunks.translation[:, ::stride]
    packed = np.empty(translation.shape[:2], pose_format.frame)
    axes.points_to_wire(translation, out=packed["translation"])
    # numba would compile the function again for other kinds of arrays
    rotations = np.require(chunks.rotations, np.float32, ("C", "W"))
    pack = _PACKERS[pose_format.encoding]
    pack(rotations, stride, pose_format.posed, *axes.quaternion_parts, packed["rotations"])
    contacts = (chunks.contacts[:, ::stride] * FOOT_BITS).sum(-1, dtype=np.uint8)
    return PackedPoses(packed.reshape(-1).view(np.uint8).data, contacts.tobytes())


@compiled
def _pack_floats(
    rotations: Float, stride: int, posed: Index, sources: Index, signs: Float, out: Float
) -> None:
    """Packs rotations [A, F · stride, 22, 4] into those of frames [A, F, B, 4]: first the bones
    `posed`, then the fingers, which are at rest. `sources` and `signs` as in
    `Axes.quaternion_parts`.
    """
    for row in range(len(out)):
        for frame in range(out.shape[1]):
            for bone in range(out.shape[2]):
                for k in range(4):
                    if bone < len(posed):
                        turned = rotations[row, stride * frame, posed[bone], sources[k]]
                        out[row, frame, bone, k] = turned * signs[k]
                    else:
                        out[row, frame, bone, k] = 1.0 if k == 3 else 0.0


@compiled
def _pack_three(
    rotations: Float, stride: int, posed: Index, sources: Index, signs: Float, out: Words
) -> None:
    """Like `_pack_floats`, into words [A, F, B, 3] of smallest_three.py."""
    still = pack_one(0.0, 0.0, 0.0, 1.0)
    for row in range(len(out)):
        for frame in range(out.shape[1]):
            for bone in range(out.shape[2]):
                words = still
                if bone < len(posed):
                    at = row, stride * frame, posed[bone]
                    words = pack_one(
                        signs[0] * rotations[(*at, sources[0])],
                        signs[1] * rotations[(*at, sources[1])],
                        signs[2] * rotations[(*at, sources[2])],
                        signs[3] * rotations[(*at, sources[3])],
                    )
                for k in range(3):
                    out[row, frame, bone, k] = words[k]


_PACKERS: Final = {
    PoseEncoding.F32_LE: _pack_floats,
    PoseEncoding.SMALLEST_THREE: _pack_three,
}


@cache
def prepare() -> None:
    """Compiles the packing, or loads it, before the first chunk is sent."""
    turns = np.ones((1, NEW_FRAMES, POSED_JOINTS, 4), np.float32)
    for encoding, pack in _PACKERS.items():
        out = np.empty((1, NEW_FRAMES), PoseFormat(encoding).frame)["rotations"]
        parts = Basis.GLTF.axes.quaternion_parts
        warm(pack, turns, 1, PoseFormat().posed, *parts, out)
