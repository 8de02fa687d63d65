"""A memory of packed poses, so that many streams cost as much as one."""

from collections import OrderedDict
from threading import Lock

from numpy.typing import NDArray

from wayfarer.transport.codec.packing import PackedPoses, encode, prepare
from wayfarer.transport.codec.pose_format import PoseFormat
from wayfarer.transport.conversion.basis import Basis
from wayfarer.world.agents.agent import MotionChunks

Key = tuple[Basis, PoseFormat, int]


class PoseEncoder:
    """Packs each publication once per basis and format, however many streams carry it.

    The key is the identity of the array of rotations: streams share it, whatever flags they add,
    and no other motion has it, even with equal numbers (clips, replays, a session imported again).
    Thread-safe: the motion thread packs, and event loops find the result here.
    """

    def __init__(self, capacity: int = 4 << 20) -> None:
        """`capacity`: maximum bytes to remember; the oldest are forgotten first."""
        prepare()
        self._capacity = capacity
        self._bytes = 0
        self._lock = Lock()
        # the array is kept too, since otherwise its id could be given to another array
        self._packed: OrderedDict[Key, tuple[PackedPoses, NDArray]] = OrderedDict()

    def encode(
        self, chunks: MotionChunks, basis: Basis, pose_format: PoseFormat = PoseFormat()
    ) -> PackedPoses:
        """Like the function `encode`, from memory if another stream has packed the chunks."""
        key = basis, pose_format, id(chunks.rotations)
        with self._lock:
            if key in self._packed:
                return self._packed[key][0]
        poses = encode(chunks, basis, pose_format)
        with self._lock:
            if key not in self._packed:
                self._packed[key] = poses, chunks.rotations
                self._bytes += poses.poses.nbytes
            while self._bytes > self._capacity:
                _, (forgotten, _) = self._packed.popitem(last=False)
                self._bytes -= forgotten.poses.nbytes
        return poses
