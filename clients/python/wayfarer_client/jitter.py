"""Smooth playback of a stream's batches: frames arrive in bursts and are asked for at any time."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayfarer_client.messages import Agent, Batch, Float, Frames
from wayfarer_client.playout import PlayoutClock, PoseTrack


@dataclass(frozen=True, slots=True)
class Pose:
    """An agent at one instant."""

    agent: Agent
    state: str
    translation: Float = field(repr=False)  # [3] hips
    rotations: Float = field(repr=False)  # [B, 4]: hips in the world, others local
    contacts: NDArray[np.bool_] = field(repr=False)  # [2] left, right foot on the ground
    held: bool = False  # frames have run out: this is the last one


class JitterBuffer:
    """Plays the agents of a stream a little late, smoothly: clients/README.md, "Playout"."""

    def __init__(self, clock: Callable[[], float] = time.time) -> None:
        """`clock` returns this machine's time in seconds."""
        self._clock = clock
        self._playout = PlayoutClock()
        self._members: dict[str, _Member] = {}
        self._underruns = 0  # of removed agents

    @property
    def underruns(self) -> int:
        """How often an agent's frames ran out."""
        return self._underruns + sum(m.track.underruns for m in self._members.values())

    @property
    def delay(self) -> float:
        """Present delay between a frame's time and its display, seconds."""
        return self._playout.delay(self._clock())

    def push(self, batch: Batch) -> None:
        """Adds what has just arrived."""
        now = self._clock()
        self._playout.observe(now, batch.sent_at)
        if batch.resumed_at is not None:
            self._playout.resumed(batch.resumed_at)
        for agent in (*batch.removed, *batch.hidden):
            gone = self._members.pop(agent.agent_id, None)
            self._underruns += gone.track.underruns if gone else 0
        for frames in batch.frames:
            self._playout.observe_chunk(now, float(frames.times[0]))
            member = self._members.setdefault(frames.agent.agent_id, _Member(frames.agent))
            member.push(frames)

    def sample(self, now: float | None = None) -> dict[str, Pose]:
        """Pose of each agent, by id, at `now` (this machine's clock; default: its present time).

        Before the time of its first frame, an agent holds that frame.
        """
        moment = self._playout.advance(self._clock() if now is None else now)
        return {agent_id: member.at(moment) for agent_id, member in self._members.items()}


class _Member:
    """An agent's frames, and its states with their times."""

    def __init__(self, agent: Agent) -> None:
        self.agent = agent
        self.track = PoseTrack()
        self._states: deque[tuple[float, str]] = deque()

    def push(self, frames: Frames) -> None:
        times = frames.times
        fps = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 1.0
        bits = frames.contacts[:, 0] + 2 * frames.contacts[:, 1].astype(np.uint8)
        self.track.push(float(times[0]), fps, frames.translation, frames.rotations, bits)
        self._states.append((float(times[0]), frames.state))
        self.agent = frames.agent

    def at(self, moment: float) -> Pose:
        sampled = self.track.sample(moment)
        assert sampled is not None  # there is a member since there are frames
        while len(self._states) > 1 and self._states[1][0] <= moment:
            self._states.popleft()
        return Pose(
            agent=self.agent,
            state=self._states[0][1],
            translation=np.asarray(sampled.translation, np.float32),
            rotations=np.asarray(sampled.rotations, np.float32),
            contacts=np.array([sampled.contacts & 1, sampled.contacts & 2], bool),
            held=sampled.held,
        )
