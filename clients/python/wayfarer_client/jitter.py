"""Smooth playback: frames arrive in bursts and are asked for at any time."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer_client.messages import Agent, Batch, Float, Frames

DELAY_S: Final = 0.35
"""Frames come 0.2 s at a time: one such chunk, and 0.15 s for the network."""

OFFSET_WINDOW: Final = 256
"""Messages over which the least delay, and so the offset of the clocks, is taken."""

HISTORY_S: Final = 1.0
"""Frames older than the last question by so much are forgotten."""


@dataclass(frozen=True, slots=True)
class Pose:
    """An agent at one instant."""

    agent: Agent
    state: str
    translation: Float = field(repr=False)  # [3] hips
    rotations: Float = field(repr=False)  # [22, 4]
    contacts: NDArray[np.bool_] = field(repr=False)  # [2] left, right foot on the ground
    held: bool = False  # frames have run out: this is the last one


class JitterBuffer:
    """Plays the agents of a stream `delay` seconds late, between frames by slerp."""

    def __init__(self, delay: float = DELAY_S, clock: Callable[[], float] = time.time) -> None:
        """`clock` returns this machine's Unix seconds."""
        self.delay = delay
        self.underruns = 0  # how often an agent's frames ran out
        self._clock = clock
        self._offsets: deque[float] = deque(maxlen=OFFSET_WINDOW)
        self._tracks: dict[str, _Track] = {}

    def push(self, batch: Batch) -> None:
        """Add what has just arrived."""
        self._offsets.append(self._clock() - batch.sent_at)
        for agent in batch.removed:
            self._tracks.pop(agent.agent_id, None)
        for frames in batch.frames:
            track = self._tracks.get(frames.agent.agent_id)
            if track is None:
                self._tracks[frames.agent.agent_id] = _Track(frames)
            else:
                track.append(frames)

    def sample(self, now: float | None = None) -> dict[str, Pose]:
        """Pose of each agent, by id, at `now` (this machine's clock; default: its present time).

        Agents whose first frame is yet to come are left out.
        """
        if not self._offsets:
            return {}
        now = self._clock() if now is None else now
        # The message that travelled fastest tells best how the clocks differ.
        moment = now - min(self._offsets) - self.delay
        poses = {}
        for agent_id, track in self._tracks.items():
            pose = track.at(moment)
            if pose is not None:
                self.underruns += pose.held and not track.was_held
                track.was_held = pose.held
                poses[agent_id] = pose
        return poses


class _Track:
    """Frames of one agent in order of time."""

    def __init__(self, frames: Frames) -> None:
        self.frames: deque[Frames] = deque([frames])
        self.was_held = False
        self._join()

    def append(self, frames: Frames) -> None:
        """Frames of before a reconnection may come twice; the later ones hold."""
        if frames.times[0] <= self.frames[-1].times[0]:
            self.frames.clear()
        self.frames.append(frames)
        self._join()

    def at(self, moment: float) -> Pose | None:
        """Pose at a time of the server's clock."""
        while len(self.frames) > 1 and self.frames[1].times[-1] < moment - HISTORY_S:
            self.frames.popleft()
        if moment < self._times[0]:
            return None
        last = len(self._times) - 1
        k = int(np.searchsorted(self._times, moment, side="right")) - 1
        after = min(k + 1, last)
        span = self._times[after] - self._times[k]
        share = float((moment - self._times[k]) / span) if span > 0 else 0.0
        chunk = next(f for f in reversed(self.frames) if f.times[0] <= moment)
        return Pose(
            agent=chunk.agent,
            state=chunk.state,
            translation=(1 - share) * self._translation[k] + share * self._translation[after],
            rotations=slerp(self._rotations[k], self._rotations[after], share),
            contacts=self._contacts[k],
            held=moment > self._times[last],
        )

    def _join(self) -> None:
        self._times = np.concatenate([f.times for f in self.frames])
        self._translation = np.concatenate([f.translation for f in self.frames])
        self._rotations = np.concatenate([f.rotations for f in self.frames])
        self._contacts = np.concatenate([f.contacts for f in self.frames])


def slerp(a: Float, b: Float, share: float) -> Float:
    """Between unit quaternions [..., 4], the short way round."""
    cosine = (a * b).sum(-1, keepdims=True)
    b = np.where(cosine < 0, -b, b)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-4  # straight line and circle are the same here
    divisor = np.where(near, 1.0, sine)
    from_a = np.where(near, 1 - share, np.sin((1 - share) * angle) / divisor)
    from_b = np.where(near, share, np.sin(share * angle) / divisor)
    mixed = from_a * a + from_b * b
    return np.asarray(mixed / np.linalg.norm(mixed, axis=-1, keepdims=True), np.float32)
