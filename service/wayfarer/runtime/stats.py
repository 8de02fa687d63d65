"""Figures of the loop, for dashboards and the viewer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, TypedDict

import numpy as np

from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentState, Sight, by_sight
from wayfarer.world.rows import Int8
from wayfarer.world.stepping.due import Due
from wayfarer.world.stepping.window import Window, mean, percentile

LATE_SECONDS: Final = 1 / FPS
"""A chunk is late if it leaves more than one frame after its time."""


@dataclass(frozen=True, slots=True)
class LoopStats:
    """Figures of the loop: now, over the last seconds, or since start."""

    agents: int
    sessions: int
    subscribers: int
    steps: int  # agent steps since start
    step_ms_mean: float  # of one engine call
    step_ms_p95: float
    late_chunks: int  # that left more than `LATE_SECONDS` after their scheduled time, since start
    lateness_ms_p95: float
    uptime_s: float
    resets: int = 0  # agents reset to a stand after a fall or a broken step, since start
    failures: int = 0  # turns of the loop that raised, since start
    skipped_steps: int = 0  # agent steps never made, as their time was over, since start
    skipped_by_sight: Mapping[str, int] = field(default_factory=dict)  # these steps by `by_sight`
    dropped_batches: int = 0  # lost by present subscribers that were too slow
    reduced_steps: int = 0  # agent steps with fewer candidates than requested, since start
    held_sessions: int = 0  # whose agents wait for a subscriber now
    states: Mapping[AgentState, int] = field(default_factory=dict)  # agents in each
    sights: Mapping[str, int] = field(default_factory=dict)  # agents by sight; see `by_sight`
    capacity: int = 0  # agents that fit, by the measured cost of a step; 0: unknown
    load: float = 0.0  # fraction of the last seconds: the engine, or the motion thread if busier
    degradation_level: int = 0  # 0: nothing is left out
    held_steps: int = 0  # agent steps left out for lack of time since the agent idles, since start
    coasted_steps: int = 0  # steps without the model, of agents seen at most as a root, since start
    refused_agents: int = 0  # not created, since they could not be stepped in time, since start
    mended_steps: int = 0  # agent steps with a knee kept within its limits, since start
    journal_failing: bool = False  # whether present changes would be lost with the process


class _Values(TypedDict):
    steps: int
    step_ms_mean: float
    step_ms_p95: float
    late_chunks: int
    lateness_ms_p95: float
    failures: int
    skipped_steps: int
    skipped_by_sight: dict[str, int]
    held_sessions: int


class ThreadFigures:
    """Counters of the motion thread, since its start or over the last seconds."""

    def __init__(self, meter: MetricsSink) -> None:
        self._meter = meter
        self.failures = 0  # turns
        self.skipped = np.zeros(len(Sight), np.int64)  # steps of agents, by `Sight`
        self.held = 0  # sessions whose agents wait now
        self.worked = 0.0  # seconds of the thread itself since the last engine call was applied
        self._steps = 0  # of agents
        self._late = 0  # chunks
        self._published = 0  # chunks, since the last engine call was applied
        self._step_seconds = Window()
        self._lateness = Window()  # of the latest chunk of each turn

    def stepped(self, now: float, seconds: float, agents: int) -> None:
        """Records that an engine call for `agents` agents took `seconds`."""
        self._steps += agents
        self._step_seconds.add(now, seconds)
        self._meter.step(seconds, agents)

    def published(self, now: float, due: Sequence[Due], sights: Int8) -> None:
        """Counts sent chunks by how well their agents are seen."""
        if not due:
            return
        lateness = now - np.concatenate([one.chunks.scheduled_at for one in due])
        self._lateness.add(now, max(0.0, float(lateness.max())))
        self._late += int(np.count_nonzero(lateness > LATE_SECONDS))
        self._meter.chunks(lateness, sights)
        self._published += len(lateness)

    def take_worked(self) -> tuple[float, int]:
        """Seconds worked and chunks published since the last call."""
        worked, published = self.worked, self._published
        self.worked, self._published = 0.0, 0
        return worked, published

    def values(self, now: float) -> _Values:
        """The values of `LoopStats` that are counted here."""
        steps = [1e3 * seconds for seconds in self._step_seconds.values(now)]
        return _Values(
            steps=self._steps,
            step_ms_mean=mean(steps),
            step_ms_p95=percentile(steps, 95),
            late_chunks=self._late,
            lateness_ms_p95=1e3 * percentile(self._lateness.values(now), 95),
            failures=self.failures,
            skipped_steps=int(self.skipped.sum()),
            skipped_by_sight=by_sight(self.skipped),
            held_sessions=self.held,
        )
