"""Which moment to show, and the pose at it: clients/README.md, "Playout".

tests/golden/playout.json checks the clients of all languages. Time is an argument, in seconds;
nothing here reads a clock.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer_client.quaternions import Array, slerp

FIRST_DELAY: Final = 0.35
MIN_DELAY: Final = 0.2
MAX_DELAY: Final = 1.5
MARGIN: Final = 0.06
"""Seconds added to the worst lateness of the last LATENESS_WINDOW."""
LATENESS_WINDOW: Final = 20.0
OFFSET_WINDOW: Final = 30.0
"""Seconds; the fastest message of this window counts as one without delay."""
STRETCH: Final = 0.05
"""Playback runs at most this much faster or slower to reach the target delay."""
JUMP: Final = 1.0
"""Error in seconds beyond which it jumps instead (after a sleep of the machine)."""
BLEND: Final = 0.2
"""Seconds to blend from a held pose to the stream again."""
KEPT: Final = 400
"""Most frames kept of an agent."""


class _WindowLeast:
    """The minimum of the last `seconds`; values in the queue rise from front to back."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.queue: deque[tuple[float, float]] = deque()

    def add(self, now: float, value: float) -> None:
        while self.queue and self.queue[-1][1] >= value:
            self.queue.pop()
        self.queue.append((now, value))

    def least(self, now: float) -> float | None:
        while self.queue and self.queue[0][0] < now - self.seconds:
            self.queue.popleft()
        return self.queue[0][1] if self.queue else None


class PlayoutClock:
    """Chooses the moment of the stream (server time) to show now, for all agents alike."""

    def __init__(self) -> None:
        self._transit = _WindowLeast(OFFSET_WINDOW)  # local - server time of each message
        self._earliness = _WindowLeast(LATENESS_WINDOW)  # of each chunk; negative when late
        self._offset: float | None = None
        self._playhead: float | None = None
        self._caught_up_at = -np.inf  # server time at which the stream was resumed last
        self._last = 0.0

    def observe(self, now: float, sent_at: float) -> None:
        """Notes a message that came at local `now`, sent at server time `sent_at`."""
        if self._offset is None:  # at first, expect as much as the first delay allows
            self._earliness.add(now, MARGIN - FIRST_DELAY)
        self._transit.add(now, now - sent_at)
        self._offset = self._transit.least(now)

    def observe_chunk(self, now: float, scheduled_at: float) -> None:
        """Notes a chunk that came at local `now`, whose first frame is for `scheduled_at`."""
        if scheduled_at >= self._caught_up_at:
            self._earliness.add(now, scheduled_at - self.server_time(now))

    def resumed(self, sent_at: float) -> None:
        """Notes that a connection was restored; its header was sent at server time `sent_at`.

        Chunks for earlier times were missed meanwhile; their lateness predicts nothing.
        """
        self._caught_up_at = sent_at

    def server_time(self, now: float) -> float:
        """The server's clock at local `now`, as if the fastest message had taken no time."""
        return now if self._offset is None else now - self._offset

    def wanted_delay(self, now: float) -> float:
        """The target delay, seconds."""
        earliness = self._earliness.least(now)
        if earliness is None:
            return MIN_DELAY
        return min(MAX_DELAY, max(MIN_DELAY, MARGIN - earliness))

    def delay(self, now: float) -> float:
        """The present delay, seconds."""
        if self._playhead is None:
            return self.wanted_delay(now)
        return self.server_time(now) - self._playhead

    def advance(self, now: float) -> float:
        """Advances to local `now`; returns the moment to show, in server time."""
        if self._offset is None:
            return now  # nothing has come yet
        ideal = self.server_time(now) - self.wanted_delay(now)
        if self._playhead is None or abs(ideal - self._playhead) > JUMP:
            self._playhead = ideal
        else:
            step = max(0.0, now - self._last)
            off = ideal - (self._playhead + step)
            self._playhead += step + min(STRETCH * step, max(-STRETCH * step, off))
        self._last = now
        return self._playhead


@dataclass(frozen=True)
class Sampled:
    """An agent at a moment."""

    translation: Array = field(repr=False)  # [3] hips
    rotations: Array = field(repr=False)  # [B, 4]
    contacts: int  # bits of the frame at or before the moment: 1 left foot, 2 right foot
    held: bool  # frames have run out: the last one is shown


class PoseTrack:
    """The frames of one agent, and its pose at moments that never go back."""

    def __init__(self) -> None:
        self.underruns = 0  # how often frames ran out
        self._frames: deque[tuple[float, Array, Array, int]] = (
            deque()
        )  # time, hips, rotations, bits
        self._starving = False
        self._shown: tuple[Array, Array] | None = None
        self._held: tuple[Array, Array] | None = None  # pose to blend from
        self._held_at = 0.0

    def push(
        self,
        time: float,
        fps: float,
        translation: Array,
        rotations: Array,
        contacts: NDArray[np.uint8],
    ) -> None:
        """Adds frames, the first of which is for `time`: [F, 3], [F, B, 4], [F].

        Known ones are dropped.
        """
        last = self._frames[-1][0] if self._frames else -np.inf
        for k, row in enumerate(zip(translation, rotations, contacts, strict=True)):
            at = time + k / fps
            if at > last + 0.25 / fps:
                self._frames.append((at, row[0], row[1], int(row[2])))
        while len(self._frames) > KEPT:
            self._frames.popleft()

    def __len__(self) -> int:
        """Number of frames in the queue."""
        return len(self._frames)

    def buffered(self, time: float) -> float:
        """Seconds of frames after `time`; negative when they have run out."""
        return self._frames[-1][0] - time if self._frames else -np.inf

    def sample(self, time: float) -> Sampled | None:
        """The pose at `time`, or None when no frame has come yet."""
        frames = self._frames
        if not frames:
            return None
        while len(frames) > 1 and frames[1][0] <= time:
            frames.popleft()  # one frame before `time` stays, to interpolate from
        dry = len(frames) == 1 and time > frames[0][0]
        if dry:
            self.underruns += not self._starving
            self._starving = True
        elif self._starving and len(frames) > 1:
            self._starving = False
            self._held, self._held_at = self._shown, time
        pose = self._between(time)
        if self._held is not None:
            share = (time - self._held_at) / BLEND
            if share >= 1:
                self._held = None
            else:
                pose = mix(self._held, pose, share * share * (3 - 2 * share))
        self._shown = pose
        return Sampled(*pose, contacts=frames[0][3], held=dry)

    def _between(self, time: float) -> tuple[Array, Array]:
        before, *rest = [self._frames[k] for k in range(min(2, len(self._frames)))]
        if not rest or time <= before[0]:
            return before[1], before[2]
        after = rest[0]
        share = (time - before[0]) / (after[0] - before[0])
        return mix(before[1:3], after[1:3], share)


def mix(a: tuple[Array, Array], b: tuple[Array, Array], share: float) -> tuple[Array, Array]:
    """Interpolates two poses (hips [3], rotations [B, 4]): linearly, and along the shorter arc."""
    return (1 - share) * a[0] + share * b[0], slerp(a[1], b[1], share)
