"""Remembers what has been packed, so that many streams cost as much as one."""

from collections import OrderedDict
from collections.abc import Sequence

from numpy.typing import NDArray

from wayfarer.runtime.agent import MotionChunk
from wayfarer.transport.basis import Basis
from wayfarer.transport.codec.packing import Poses, encode
from wayfarer.transport.codec.pose_format import PoseFormat

Key = tuple[Basis, PoseFormat, int]


class PoseEncoder:
    """Packs each chunk once per basis and format, however many streams carry it.

    A chunk is known by its array of rotations: streams share it, whatever flags they add, and no
    other motion has it, even where numbers repeat (clips, replays, a session imported again).
    """

    def __init__(self, capacity: int = 4096) -> None:
        """`capacity`: chunks that are remembered, the oldest are forgotten."""
        self._capacity = capacity
        # the array is kept beside its id, which would otherwise be given to another one
        self._packed: OrderedDict[Key, tuple[Poses, NDArray]] = OrderedDict()

    def encode(
        self, chunks: Sequence[MotionChunk], basis: Basis, pose_format: PoseFormat = PoseFormat()
    ) -> list[Poses]:
        """As the function `encode`, from memory where another stream was first."""
        keys = [(basis, pose_format, id(chunk.rotations)) for chunk in chunks]
        fresh = [i for i, key in enumerate(keys) if key not in self._packed]
        made = encode([chunks[i] for i in fresh], basis, pose_format)
        for i, poses in zip(fresh, made, strict=True):
            self._packed[keys[i]] = (poses, chunks[i].rotations)
        result = [self._packed[key][0] for key in keys]
        while len(self._packed) > self._capacity:
            self._packed.popitem(last=False)
        return result
