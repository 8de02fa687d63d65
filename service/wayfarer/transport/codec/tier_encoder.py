"""Packs some of a publication's chunks, each once per basis and format."""

from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.transport.codec.packing import PackedPoses, encode, prepare
from wayfarer.transport.codec.pose_format import PoseEncoding, PoseFormat
from wayfarer.transport.codec.root import pack_roots
from wayfarer.transport.conversion.basis import Basis
from wayfarer.world.agents.agent import MotionChunks

Key = tuple[Basis, PoseFormat, int]
Rows = NDArray[np.intp]


@dataclass(slots=True)
class _Packed:
    """The chunks of one publication, some of them packed."""

    rotations: NDArray[np.float32]  # kept, so that its id is not given to another array
    poses: NDArray[np.uint8]  # [A, bytes of a chunk]
    contacts: NDArray[np.uint8]  # [A, F]
    done: NDArray[np.bool_]  # [A]


class TierEncoder:
    """Like PoseEncoder, for streams that carry some of the chunks in each of several formats.

    Readers that have the same agents in the same format share the packed chunks. A chunk is packed
    only in the formats in which some reader has it.
    """

    def __init__(self, capacity: int = 4 << 20) -> None:
        """`capacity`: maximum bytes to remember; the oldest are forgotten first."""
        prepare()
        self._capacity = capacity
        self._bytes = 0
        self._packed: OrderedDict[Key, _Packed] = OrderedDict()

    def encode(
        self,
        chunks: MotionChunks,
        rows: Rows,
        basis: Basis,
        pose_format: PoseFormat,
        roots: NDArray[np.float32] | None = None,
    ) -> PackedPoses:
        """Packs the chunks `rows`, in this order. `roots`: of all chunks, for the encoding ROOT."""
        packed = self._of(chunks, basis, pose_format)
        missing = rows[~packed.done[rows]]
        if len(missing):
            poses, contacts = _encode(chunks, missing, basis, pose_format, roots)
            packed.poses[missing], packed.contacts[missing] = poses, contacts
            packed.done[missing] = True
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
    rows: Rows,
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
        bits = (contacts * np.array([1, 2], np.uint8)).sum(-1, dtype=np.uint8)
        return frames.view(np.uint8).reshape(len(rows), -1), bits
    poses, packed_contacts = encode(chunks.take(rows), basis, pose_format)
    return (
        np.frombuffer(poses, np.uint8).reshape(len(rows), -1),
        np.frombuffer(packed_contacts, np.uint8).reshape(len(rows), -1),
    )
