"""A memory of packed poses, so that many streams cost as much as one."""

from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.transport.codec.packing import FOOT_BITS, PackedPoses, encode, prepare
from wayfarer.transport.codec.pose_format import PoseEncoding, PoseFormat
from wayfarer.transport.codec.root import pack_roots
from wayfarer.transport.conversion.basis import Basis
from wayfarer.world.agents.agent import MotionChunks

Key = tuple[Basis, PoseFormat, int]
Rows = NDArray[np.intp]


@dataclass(slots=True)
class _Packed:
    """The chunks of one publication, all or some of them packed."""

    rotations: NDArray[np.float32]  # kept, so that its id is not given to another array
    poses: NDArray[np.uint8]  # [A, bytes of a chunk]
    contacts: NDArray[np.uint8]  # [A, F]
    done: NDArray[np.bool_]  # [A]


class PoseEncoder:
    """Packs each chunk once per basis and format, however many streams carry it, and only in the
    formats in which some reader has it.

    The key is the identity of the array of rotations: streams share it, whatever flags they add,
    and no other motion has it, even with equal numbers (clips, replays, a session imported again).
    Thread-safe: the motion thread packs, and event loops find the result here.
    """

    def __init__(self, capacity: int = 4 << 20) -> None:
        """`capacity`: maximum bytes to remember, or one publication; the oldest are forgotten
        first.
        """
        prepare()
        self._capacity = capacity
        self._bytes = 0
        self._lock = Lock()
        self._packed: OrderedDict[Key, _Packed] = OrderedDict()

    def encode(
        self,
        chunks: MotionChunks,
        basis: Basis,
        pose_format: PoseFormat = PoseFormat(),
        rows: Rows | None = None,
        roots: NDArray[np.float32] | None = None,
    ) -> PackedPoses:
        """Packs all chunks, or the chunks `rows` in this order. `roots`: of all chunks, for the
        encoding ROOT.
        """
        with self._lock:
            packed = self._of(chunks, basis, pose_format)
        if rows is None and not packed.done.any():
            packed.poses, packed.contacts = _encode(chunks, slice(None), basis, pose_format, roots)
            packed.done[:] = True
        wanted = np.arange(len(chunks)) if rows is None else rows
        missing = wanted[~packed.done[wanted]]
        if len(missing):
            poses, contacts = _encode(chunks, missing, basis, pose_format, roots)
            packed.poses[missing], packed.contacts[missing] = poses, contacts
            packed.done[missing] = True
        if rows is None:
            return PackedPoses(packed.poses.reshape(-1).data, packed.contacts.tobytes())
        poses = packed.poses[rows]
        return PackedPoses(poses.reshape(-1).data, packed.contacts[rows].tobytes())

    def _of(self, chunks: MotionChunks, basis: Basis, pose_format: PoseFormat) -> _Packed:
        key = basis, pose_format, id(chunks.rotations)
        if key in self._packed:
            return self._packed[key]
        frames = len(range(0, chunks.rotations.shape[1], pose_format.stride))
        made = _Packed(
            chunks.rotations,
            np.empty((len(chunks), frames * pose_format.frame_bytes), np.uint8),
            np.empty((len(chunks), frames), np.uint8),
            np.zeros(len(chunks), bool),
        )
        self._packed[key] = made
        self._bytes += made.poses.nbytes
        while self._bytes > self._capacity and len(self._packed) > 1:
            _, forgotten = self._packed.popitem(last=False)
            self._bytes -= forgotten.poses.nbytes
        return made


def _encode(
    chunks: MotionChunks,
    rows: Rows | slice,
    basis: Basis,
    pose_format: PoseFormat,
    roots: NDArray[np.float32] | None,
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Poses [N, bytes] and contacts [N, F] of the chunks of `rows`."""
    if pose_format.encoding is PoseEncoding.ROOT:
        if roots is None:
            raise ValueError("the encoding ROOT needs roots")
        frames = pack_roots(roots[rows], basis)
        contacts = chunks.contacts[rows, :: pose_format.stride]
        bits = (contacts * FOOT_BITS).sum(-1, dtype=np.uint8)
        return frames.view(np.uint8).reshape(len(frames), -1), bits
    chosen = chunks if isinstance(rows, slice) else chunks.take(rows)
    packed = encode(chosen, basis, pose_format)
    poses, bits = (np.frombuffer(part, np.uint8).reshape(len(chosen), -1) for part in packed)
    return poses, bits
