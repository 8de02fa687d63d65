"""Counts of faults in a scene: bodies in walls and in each other, feet off the ground, and more.

`cubes`: the paper's field of 20 × 20 m with 30 boxes, random starts and goals, everybody alone (as
in `slope`, `storeys`, `doors`, `crates`). `corridor`: two streams of people who change sides.
`doorway`: 8 people in either of two rooms change rooms through a door of 1.2 m. `square`: people by
`PopulateSession` for some minutes. `slope`, `storeys`: up and down again. `doors`: the door to the
goal's room shuts 2 m before the agent and opens after 6 s. `crates`: a crate is dropped 2 m before
the agent. Every frame counts; in `corridor` and `doorway` every second one, in `square` every
eighth. The JSON's `meta` lists the worst moments of each scenario (number of the agent, time).

Figures:
    success: share that reaches its last goal within 10 s + path ÷ 0.5 m/s (`slope`, `storeys`: 15 s
        + path ÷ 0.4 m/s; `corridor`, `doorway`: 90 s); `doors`: that waits while the door is shut,
        and arrives afterwards; `crates`: that arrives within 45 s; `square`: that is never stuck
    agent_frames: number of frames of all agents that count
    goals_per_minute_each: goals reached by an agent per minute
    seconds_median: time until arrival, median
    seconds_last: time until the last agent has arrived
    penetration_frames: share of frames in which skin (1,296 points) is more than 1 cm inside a
        solid or obstacle, in space: a hand above a low box is free. Feet do not count in what is
        walked on; in a wall of 15 cm nobody is deeper than 7.5
    penetration_5cm: the same for more than 5 cm
    penetration_mean_cm: mean depth in `penetration_frames`
    penetration_max_cm: greatest depth
    overlap_frames: share of an agent's frames in which it is more than 5 cm inside another agent:
        16 capsules along bones, with the median distance of the skin that a bone moves as radius
    overlap_max_cm: greatest overlap
    path_ratio*: path found ÷ shortest possible one (visibility graph over the free ground)
    walked_ratio: distance walked by the hips (positions 0.6 s apart) plus what is left to the goal,
        ÷ the same
    stuck_agents: agents with a goal not reached that stay within 0.3 m of one place for 10 s or
        more
    stuck_seconds: seconds of being stuck, all agents
    foot_gap_uneven_*: the same where the ground 25 cm around differs by 2 cm
    foot_gap_*: magnitude of the height of a foot's lowest sole point above the ground under it
        (from the solids, not from samples), where contact is reported
    *_felt_s_*: seconds from a change of the scene (a door that shuts or opens, a crate) until the
        hips differ by 1 mm from those of a run without the change
    *_seen_s_*: the same by 5 cm
    cpu_load: CPU seconds per second of motion, of all agents of the row
    cpu_us_per_step: CPU time of one agent's step, µs
    engine_share: the engine's share of the CPU time
    navigation_share: the share of finding the way
    avoidance_share: the share of collision avoidance
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
    total: float = 0.0  # metres, of touching bodies
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
        """Share of all frames; NaN without any."""
        return count / self.frames if self.frames else float("nan")

    @property
    def mean(self) -> float:
        """Mean depth of touching frames, metres; 0 when none touches."""
        return self.total / self.touching if self.touching else 0.0

    @property
    def deepest(self) -> float:
        """Metres."""
        return self.worst[0][0] if self.worst else 0.0

    def _keep(self, depth: float, agent: int, frame: int) -> None:
        """Keeps the deepest moment of each of the deepest agents."""
        best = {who: (d, who, at) for d, who, at in reversed(self.worst)}
        if agent not in best or best[agent][0] < depth:
            best[agent] = (depth, agent, frame)
        self.worst = sorted(best.values(), reverse=True)[:WORST]


@dataclass
class Gaps:
    """Distances from the ground of feet whose flag says that they touch it."""

    name: str
    found: list[NDArray[np.float32]] = field(default_factory=list)

    def add(self, gap: Array) -> None:
        """Metres [N] from the lowest sole point to the ground below it; negative: sunk."""
        self.found.append(gap.astype(np.float32))

    def figures(self) -> Row:
        """Magnitudes of the gaps, since sinking is as wrong as floating. None without gaps."""
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
