"""What became of one goal run: a pure function of the streamed hips and states."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.evaluation.gait import Row
from wayfarer.spec import FPS, NEW_FRAMES

Array = NDArray[np.floating[Any]]

REACHED: Final = 0.75
"""Metres, horizontal, hips to goal: reached, as in the paper (Sec. 4.2)."""

NEAR: Final = 0.3
"""Metres: reached in the stricter sense."""

STEP_LIMIT: Final = 60
"""Primitives within which the goal has to be reached (paper Sec. 4.2)."""

STAND_SECONDS: Final = 5
"""How long an agent is watched after it has come to a stand."""

STAND_DRIFT: Final = 0.5
"""Metres that a standing agent may move away from where it came to a stand."""


@dataclass(frozen=True)
class Outcome:
    """Of one goal; frames count from the first new frame made for it. NaN: never happened."""

    reached: int | None  # frame at which the hips are first within 0.75 m, in 60 primitives
    near: bool  # within 0.3 m in 60 primitives
    final_distance: float  # metres, after 60 primitives
    stopped: int | None  # first frame of standing after the goal was reached
    arrival_error: float  # metres, hips to goal at that frame
    drift: float  # metres, farthest in the 5 s from that frame

    @property
    def steps(self) -> float:
        """Primitives until the goal was reached."""
        return float("nan") if self.reached is None else self.reached // NEW_FRAMES + 1

    def walking(self) -> slice:
        """Frames on the way: to the goal, or all that count."""
        return slice(0, STEP_LIMIT * NEW_FRAMES if self.reached is None else self.reached)

    def standing(self) -> slice | None:
        """Frames from 1 s after coming to a stand until 5 s after it."""
        if self.stopped is None:
            return None
        return slice(self.stopped + FPS, self.stopped + STAND_SECONDS * FPS)


def judge(hips: Array, standing: NDArray[np.bool_], goal: Array) -> Outcome:
    """Outcome from hips [T, 3], standing [T] (the agent says it stands) and goal [2 or 3]; T ≥ 480.

    A stand counts when it comes after the goal was reached and can be watched for 5 s.
    """
    limit = STEP_LIMIT * NEW_FRAMES
    distance = np.linalg.norm(hips[:, :2] - np.asarray(goal)[:2], axis=-1)
    within = np.flatnonzero(distance[:limit] <= REACHED)
    reached = int(within[0]) if len(within) else None

    stopped, arrival_error, drift = None, float("nan"), float("nan")
    if reached is not None:
        watched = len(hips) - STAND_SECONDS * FPS
        stands = reached + np.flatnonzero(standing[reached : max(watched + 1, reached)])
        if len(stands):
            stopped = int(stands[0])
            arrival_error = float(distance[stopped])
            after = hips[stopped : stopped + STAND_SECONDS * FPS, :2] - hips[stopped, :2]
            drift = float(np.linalg.norm(after, axis=-1).max())
    return Outcome(
        reached=reached,
        near=bool((distance[:limit] <= NEAR).any()),
        final_distance=float(distance[:limit][-1]),
        stopped=stopped,
        arrival_error=arrival_error,
        drift=drift,
    )


def goal_row(name: str, outcomes: list[Outcome]) -> Row:
    """Figures of many runs. Averages are over the runs in which the thing happened."""
    reached = [o for o in outcomes if o.reached is not None]
    stopped = [o for o in outcomes if o.stopped is not None]
    return {
        "name": name,
        "runs": len(outcomes),
        "success_075m": len(reached) / len(outcomes),
        "success_03m": sum(o.near for o in outcomes) / len(outcomes),
        "steps": _mean([o.steps for o in reached]),
        "final_distance_m": _mean([o.final_distance for o in outcomes]),
        "stopped": len(stopped) / len(outcomes),
        "arrival_error_m": _mean([o.arrival_error for o in stopped]),
        "drift_5s_mean_m": _mean([o.drift for o in stopped]),
        "drift_5s_max_m": max((o.drift for o in stopped), default=float("nan")),
        "stays_within_05m": _mean([float(o.drift <= STAND_DRIFT) for o in stopped]),
    }


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else float("nan")
