"""Counts of faults in a scene: bodies in walls and in each other, feet off the ground, agents
that are stuck. Each measure collects while motion passes and gives its figures at the end.
"""

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import ChunkFlag, MotionChunk
from wayfarer_lab.evaluation.gait import Row

Array = NDArray[np.floating[Any]]

TOUCHING: Final = 0.01
"""Metres of skin in an obstacle from which a frame counts: less cannot be seen."""

DEEP: Final = 0.05
"""Metres of depth from which bodies overlap visibly."""

STUCK_SECONDS: Final = 10.0
STUCK_METRES: Final = 0.3
"""An agent with a goal ahead that moves less than this distance in this time is stuck."""

WORST: Final = 5
"""Number of moments that are kept for inspection."""


@dataclass
class Depths:
    """How deep bodies are in something, body by body and frame by frame."""

    frames: int = 0
    touching: int = 0
    deep: int = 0
    total: float = 0.0  # metres, of those that touch
    worst: list[tuple[float, int, int]] = field(default_factory=list)  # metres, agent, frame

    def add(self, depth: Array, agent: NDArray[np.int64], frame: NDArray[np.int64]) -> None:
        """Depths [R] of agents in frames; 0 if it touches nothing."""
        self.frames += len(depth)
        touching = depth > TOUCHING
        self.touching += int(touching.sum())
        self.deep += int((depth > DEEP).sum())
        self.total += float(depth[touching].sum())
        for row in np.argsort(-depth)[:WORST]:
            if depth[row] > 0:
                self._keep(float(depth[row]), int(agent[row]), int(frame[row]))

    def share(self, count: int) -> float:
        """Of all frames; NaN without any."""
        return count / self.frames if self.frames else float("nan")

    @property
    def mean(self) -> float:
        """Metres, of those that touch; 0 when none does."""
        return self.total / self.touching if self.touching else 0.0

    @property
    def deepest(self) -> float:
        """Metres."""
        return self.worst[0][0] if self.worst else 0.0

    def _keep(self, depth: float, agent: int, frame: int) -> None:
        """The deepest moment of each of the agents who were deepest."""
        best = {who: (d, who, at) for d, who, at in reversed(self.worst)}
        if agent not in best or best[agent][0] < depth:
            best[agent] = (depth, agent, frame)
        self.worst = sorted(best.values(), reverse=True)[:WORST]


@dataclass
class Gaps:
    """Between a foot that says it touches the ground, and the ground."""

    name: str
    found: list[NDArray[np.float32]] = field(default_factory=list)

    def add(self, gap: Array) -> None:
        """Metres [N] from the lowest sole point to the ground below it; negative: sunk."""
        self.found.append(gap.astype(np.float32))

    def figures(self) -> Row:
        """Of the gaps' magnitudes: sinking is as wrong as floating. None without gaps."""
        gaps = np.abs(np.concatenate(self.found)) if self.found else np.empty(0)
        if not len(gaps):
            return {}
        return {
            f"{self.name}_mean_cm": 100 * float(gaps.mean()),
            f"{self.name}_p95_cm": 100 * float(np.quantile(gaps, 0.95)),
        }


@dataclass
class ProgressWatch:
    """Whether an agent makes progress while it has a goal ahead."""

    stuck_seconds: float = 0.0
    stuck_at: float | None = None  # when it was first found stuck
    arrivals: int = 0
    _goal: tuple[int, int] = (0, 0)  # revision, waypoint
    _there: bool = False
    _anchor: tuple[Array, float] | None = None

    def see(self, chunk: MotionChunk) -> None:
        """The agent's next chunk."""
        goal = (chunk.goal_revision, chunk.waypoint)
        if goal != self._goal:
            self._goal, self._there = goal, False
        if ChunkFlag.ARRIVED in chunk.flags:
            self.arrivals += not self._there
            self._there = True
        place, now = chunk.translation[-1, :2], chunk.scheduled_at
        if self._there or not chunk.goal_revision:
            self._anchor = None
        elif self._anchor is None or np.linalg.norm(place - self._anchor[0]) > STUCK_METRES:
            self._anchor = place, now
        elif now - self._anchor[1] >= STUCK_SECONDS:
            self.stuck_seconds += STEP_SECONDS
            self.stuck_at = now if self.stuck_at is None else self.stuck_at
