"""Poses ↔ bytes. docs/wire-format.md shows the layout byte by byte.

POSE_ENCODING_F32_LE, per frame: hips translation x, y, z; then 22 quaternions x, y, z, w; all
32-bit little-endian floats. Contacts: one byte per frame, bit 0 left foot, bit 1 right foot.
"""

from collections import OrderedDict
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument
from wayfarer.runtime.agent import MotionChunk
from wayfarer.spec import POSED_JOINTS
from wayfarer.transport.basis import Basis

FRAME_FLOATS: Final = 3 + 4 * POSED_JOINTS
FRAME_BYTES: Final = 4 * FRAME_FLOATS
LEFT: Final = 1
RIGHT: Final = 2


class Poses(NamedTuple):
    """The frames of one chunk as they go on the wire."""

    poses: bytes
    contacts: bytes


def encode(chunks: Sequence[MotionChunk], basis: Basis) -> list[Poses]:
    """Pack chunks, all at once, into the basis."""
    if not chunks:
        return []
    axes = basis.axes
    translation = axes.points_to_wire(np.concatenate([c.translation for c in chunks]))
    rotations = axes.quaternions_to_wire(np.concatenate([c.rotations for c in chunks]))
    packed = np.empty((len(translation), FRAME_FLOATS), dtype="<f4")
    packed[:, :3] = translation
    packed[:, 3:] = rotations.reshape(len(rotations), -1)
    touching = np.concatenate([c.contacts for c in chunks]) @ np.array([LEFT, RIGHT])
    contacts = touching.astype(np.uint8)
    ends = np.cumsum([len(c.translation) for c in chunks])
    starts = ends - [len(c.translation) for c in chunks]
    return [
        Poses(packed[a:b].tobytes(), contacts[a:b].tobytes())
        for a, b in zip(starts, ends, strict=True)
    ]


def decode(
    poses: bytes, contacts: bytes, basis: Basis
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """Back to the core basis: translation [F, 3], rotations [F, 22, 4], contacts [F, 2].

    Raises InvalidArgument where the lengths do not fit.
    """
    if len(poses) != FRAME_BYTES * len(contacts):
        raise InvalidArgument(
            f"{len(poses)} bytes of poses for {len(contacts)} frames of {FRAME_BYTES} bytes",
            "poses",
        )
    packed = np.frombuffer(poses, dtype="<f4").reshape(-1, FRAME_FLOATS)
    translation = basis.axes.points_to_core(packed[:, :3])
    rotations = basis.axes.quaternions_to_core(packed[:, 3:].reshape(-1, POSED_JOINTS, 4))
    bits = np.frombuffer(contacts, dtype=np.uint8)
    return translation, rotations, (bits[:, None] & np.array([LEFT, RIGHT])).astype(bool)


class PoseEncoder:
    """Encodes each chunk once per basis, however many streams carry it."""

    def __init__(self, capacity: int = 1024) -> None:
        self._capacity = capacity
        self._packed: OrderedDict[tuple[Basis, str, int], Poses] = OrderedDict()

    def encode(self, chunks: Sequence[MotionChunk], basis: Basis) -> list[Poses]:
        """As the function `encode`, from memory where another stream was first."""
        keys = [(basis, chunk.agent_id, chunk.seq) for chunk in chunks]
        fresh = [i for i, key in enumerate(keys) if key not in self._packed]
        made = dict(zip(fresh, encode([chunks[i] for i in fresh], basis), strict=True))
        result = [made[i] if i in made else self._packed[key] for i, key in enumerate(keys)]
        self._packed.update((keys[i], poses) for i, poses in made.items())
        while len(self._packed) > self._capacity:
            self._packed.popitem(last=False)
        return result
