"""Smooth roots: the places of a session's agents, their headings and the phases of their gait.

For readers that want no poses: a crowd far away. Hips surge and sway with each step, and the pelvis
turns; the root follows them with the alpha-beta filter of clients/README.md ("Smooth root"), which
has no lag at steady speed. Lives on the motion thread, like the publisher.

The phase of the gait comes from the swing of the legs. During a walk, the sine of the left thigh's
angle before the pelvis minus that of the right follows A cos(2π phase). At phase 0 the left leg is
farthest forward and strikes the ground; at 0.5 the right one does.
"""

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS
from wayfarer.world.agents.agent import MotionChunks

ROOT_FPS: Final = 10
STRIDE: Final = FPS // ROOT_FPS
STEP: Final = 1 / ROOT_FPS

SMOOTHING: Final = np.array([0.3, 0.3, 0.3, 0.3, 0.15])
"""Time constants of x, y, z, heading and phase, in seconds."""

STRIDE_SMOOTHING: Final = 0.2
"""Time constant of the stride, in seconds."""

JUMP: Final = 2.0
"""Distance in metres beyond which a root starts again in place."""

CADENCE: Final = (0.5, 1.0, 1.6)
"""Minimum, usual, maximum strides per second, to weigh the legs' speed against their angle."""

CLEAR_SWING: Final = 0.2
"""Swing from which it fully determines the phase; while an agent stands, the phase stays."""

LEFT_HIP, RIGHT_HIP = 1, 2
COLUMNS: Final = 6
"""x, y, z (metres), heading (radians), phase (turns), stride (swing of the legs, 0 to 2)."""

Roots = NDArray[np.float32]
"""Roots [A, R, COLUMNS]: for each chunk, its frames at 10 per second."""


class RootTracks:
    """The roots of one session's agents, from chunk to chunk."""

    def __init__(self) -> None:
        self._slots: dict[str, int] = {}
        self._free: list[int] = []
        self._seq = np.zeros(0, np.int64)  # of the agent's last chunk
        self._value = np.zeros((0, 5))
        self._rate = np.zeros((0, 5))  # per second
        self._swing = np.zeros(0)

    def __len__(self) -> int:
        return len(self._slots)

    def forget(self, agent_id: str) -> None:
        """Forgets a deleted agent."""
        slot = self._slots.pop(agent_id, None)
        if slot is not None:
            self._free.append(slot)
            self._seq[slot] = -2

    def follow(self, chunks: MotionChunks) -> Roots:
        """The roots of chunks that follow the previous ones. An agent starts in place if its
        previous chunk was missed.
        """
        rows = np.array([self._slot(name) for name in chunks.agent_id], np.intp)
        value, rate, swing = self._value[rows], self._rate[rows], self._swing[rows]
        frames = range(0, chunks.translation.shape[1], STRIDE)
        found = np.empty((len(chunks), len(frames), COLUMNS), np.float32)
        legs = _swing(chunks.rotations)
        starts = self._seq[rows] != chunks.seq - 1
        for k, frame in enumerate(frames):
            target, amplitude = _measured(chunks, frame, legs, rate[:, 4])
            starts |= np.abs(target[:, :3] - value[:, :3]).max(1, initial=0) > JUMP
            value[starts], rate[starts], swing[starts] = target[starts], 0.0, amplitude[starts]
            going = ~starts
            _follow(value, rate, target, amplitude, going)
            swing += (1 - math.exp(-STEP / STRIDE_SMOOTHING)) * (amplitude - swing) * going
            found[:, k, :5], found[:, k, 5] = value, swing
            starts = np.zeros(len(chunks), bool)
        self._seq[rows], self._value[rows], self._rate[rows] = chunks.seq, value, rate
        self._swing[rows] = swing
        return found

    def _slot(self, agent_id: str) -> int:
        slot = self._slots.get(agent_id)
        if slot is None:
            if not self._free:
                self._grow()
            slot = self._slots[agent_id] = self._free.pop()
        return slot

    def _grow(self) -> None:
        size = len(self._seq)
        more = max(64, size)
        self._free.extend(range(size + more - 1, size - 1, -1))
        self._seq = np.concatenate([self._seq, np.full(more, -2, np.int64)])
        self._value = np.concatenate([self._value, np.zeros((more, 5))])
        self._rate = np.concatenate([self._rate, np.zeros((more, 5))])
        self._swing = np.concatenate([self._swing, np.zeros(more)])


def _swing(rotations: NDArray[Any]) -> NDArray[np.float64]:
    """How far the left leg is before the right [A, F]; rotations [A, F, 22, 4], core basis.

    A thigh hangs along -Z; turned by the hip's (x, y, z, w), it reaches 2 (w x - y z) along +Y.
    """
    left, right = (rotations[:, :, bone].astype(float) for bone in (LEFT_HIP, RIGHT_HIP))
    return 2 * (
        left[..., 3] * left[..., 0]
        - left[..., 1] * left[..., 2]
        - right[..., 3] * right[..., 0]
        + right[..., 1] * right[..., 2]
    )


def _measured(
    chunks: MotionChunks, frame: int, legs: NDArray[np.float64], cadence: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The filter's state [A, 5] and the amplitude of the legs' swing [A], at one frame."""
    target = np.empty((len(chunks), 5))
    target[:, :3] = chunks.translation[:, frame]
    x, y, z, w = np.moveaxis(chunks.rotations[:, frame, 0].astype(float), -1, 0)
    target[:, 3] = np.arctan2(2 * (w * z - x * y), 1 - 2 * (x * x + z * z))
    before, after = max(frame - 1, 0), min(frame + 1, legs.shape[1] - 1)
    least, usual, most = CADENCE
    known = np.where(np.abs(cadence) > least, np.abs(cadence), usual).clip(least, most)
    speed = (legs[:, after] - legs[:, before]) * (FPS / max(after - before, 1))
    across = -speed / (2 * math.pi * known)
    target[:, 4] = np.arctan2(across, legs[:, frame]) / (2 * math.pi)
    return target, np.hypot(across, legs[:, frame])


def _follow(
    value: NDArray[np.float64],
    rate: NDArray[np.float64],
    target: NDArray[np.float64],
    amplitude: NDArray[np.float64],
    going: NDArray[np.bool_],
) -> None:
    """Makes one step of the filter, in place, for the rows `going`."""
    ahead = value + rate * STEP
    off = target - ahead
    off[:, 3] = np.remainder(off[:, 3] + math.pi, 2 * math.pi) - math.pi
    off[:, 4] = np.remainder(off[:, 4] + 0.5, 1.0) - 0.5
    clear = np.minimum(amplitude / CLEAR_SWING, 1.0) ** 2
    off[:, 4] *= clear
    theta = np.exp(-STEP / SMOOTHING)
    followed = ahead + (1 - theta**2) * off
    faster = rate + (1 - theta) ** 2 / STEP * off
    faster[:, 4] *= clear
    value[going], rate[going] = followed[going], faster[going]
    value[:, 4] %= 1.0
