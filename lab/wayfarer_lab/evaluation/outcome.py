"""How an agent reached one goal and stood: a pure function of its trajectory."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.world.agents.heading import facing_at
from wayfarer_lab.evaluation.figures import (
    degrees_off,
    distances,
    first,
    mean,
    primitives,
    quantile,
    share,
)
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.tasks import Trajectory

REACHED: Final = 0.75
"""Metres, horizontal, hips to goal: reached, as in the paper (Sec. 4.2)."""

NEAR: Final = 0.3
"""Metres: reached in the stricter sense."""

STEP_LIMIT: Final = 60
"""Primitives within which the goal has to be reached (paper Sec. 4.2)."""

STAND_SECONDS: Final = 5
"""Seconds of standing that are measured after a stop."""

DRIFT_SECONDS: Final = 2
"""Seconds after the stop for the shorter of the two drifts."""


@dataclass(frozen=True)
class GoalOutcome:
    """Events of a run to a goal; frames count from the first one made for it, NaN: never."""

    reached: int | None  # frame at which the hips are first within 0.75 m, in 60 primitives
    near: int | None  # within 0.3 m, in 60 primitives
    final_distance: float  # metres, after 60 primitives
    stopped: int | None  # first frame of standing after the goal was reached
    arrival_error: float  # metres, hips to goal at that frame
    facing_error: float  # degrees from the target heading at that frame; NaN: there was none
    drift_2s: float  # metres, farthest from there in the 2 s after that frame
    drift_5s: float  # the same for 5 s

    @property
    def steps(self) -> float:
        """Primitives until the goal was reached."""
        return primitives(self.reached)

    @property
    def seconds_to_stand(self) -> float:
        """Seconds from reaching the goal to standing."""
        if self.reached is None or self.stopped is None:
            return float("nan")
        return (self.stopped - self.reached) / FPS

    def walking(self) -> slice:
        """Frames on the way: to the goal, or all that count."""
        return slice(0, STEP_LIMIT * NEW_FRAMES if self.reached is None else self.reached)

    def standing(self) -> slice | None:
        """Frames from 1 s after coming to a stand until 5 s after it."""
        if self.stopped is None:
            return None
        return slice(self.stopped + FPS, self.stopped + STAND_SECONDS * FPS)


def goal_outcome(trajectory: Trajectory) -> GoalOutcome:
    """Outcome of the goal of the last order.

    A stand counts when it comes after the goal was reached and can be watched for 5 s.
    """
    trajectory = trajectory.latest()
    goal, hips = trajectory.goal, trajectory.hips
    limit = STEP_LIMIT * NEW_FRAMES
    distance = distances(hips, goal)
    reached = first(distance[:limit] <= REACHED)

    stopped, drift = None, np.full(STAND_SECONDS * FPS, np.nan)
    arrival_error = facing_error = float("nan")
    if reached is not None:
        time = np.arange(len(hips))
        stopped = first(trajectory.standing & (time >= reached) & (time <= len(hips) - len(drift)))
    if stopped is not None:
        arrival_error = float(distance[stopped])
        drift = distances(hips[stopped : stopped + len(drift)], hips[stopped])
        if goal.heading is not None:
            facing_error = float(degrees_off(trajectory.facing[stopped], facing_at(goal.heading)))
    return GoalOutcome(
        reached=reached,
        near=first(distance[:limit] <= NEAR),
        final_distance=float(distance[:limit][-1]),
        stopped=stopped,
        arrival_error=arrival_error,
        facing_error=facing_error,
        drift_2s=float(drift[: DRIFT_SECONDS * FPS].max()),
        drift_5s=float(drift.max()),
    )


def goal_row(name: str, outcomes: Sequence[GoalOutcome]) -> Row:
    """Figures of many runs to a goal; averages are over the runs in which the event happened.

    Figures:
        success: share within 0.75 m of the goal in 60 primitives
        success_03m: the same within 0.3 m
        steps: primitives until `success`, mean
        final_distance_m: distance after 60 primitives
        stopped: share that came to a stand after reaching the goal
        arrival_error_*: distance from hips to goal at that moment
        seconds_to_stand: time from 0.75 m to the stand, median
        drift_2s_*: farthest distance from there in the 2 s afterwards
        drift_5s_*: the same in 5 s
        facing_error_*: angle off the asked heading
    """
    return {
        "name": name,
        "runs": len(outcomes),
        "success": share([o.reached is not None for o in outcomes]),
        "success_03m": share([o.near is not None for o in outcomes]),
        "steps": mean([o.steps for o in outcomes]),
        "final_distance_m": mean([o.final_distance for o in outcomes]),
        "stopped": share([o.stopped is not None for o in outcomes]),
        "arrival_error_median_m": quantile([o.arrival_error for o in outcomes], 0.5),
        "arrival_error_mean_m": mean([o.arrival_error for o in outcomes]),
        "seconds_to_stand": quantile([o.seconds_to_stand for o in outcomes], 0.5),
        "drift_2s_mean_m": mean([o.drift_2s for o in outcomes]),
        "drift_2s_p95_m": quantile([o.drift_2s for o in outcomes], 0.95),
        "drift_5s_mean_m": mean([o.drift_5s for o in outcomes]),
        "drift_5s_max_m": quantile([o.drift_5s for o in outcomes], 1.0),
        "facing_error_median_deg": quantile([o.facing_error for o in outcomes], 0.5),
        "facing_error_p90_deg": quantile([o.facing_error for o in outcomes], 0.9),
    }
