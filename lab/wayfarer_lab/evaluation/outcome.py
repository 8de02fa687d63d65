"""When an agent reached a goal, as the paper counts it: a pure function of its trajectory."""

from dataclasses import dataclass
from typing import Final

from wayfarer.spec import NEW_FRAMES
from wayfarer_lab.evaluation.figures import distances, first
from wayfarer_lab.evaluation.tasks import Trajectory

REACHED: Final = 0.75
"""Metres, horizontal, hips to goal: reached, as in the paper (Sec. 4.2)."""

NEAR: Final = 0.3
"""Metres: reached in the stricter sense."""

STEP_LIMIT: Final = 60
"""Primitives within which the goal has to be reached (paper Sec. 4.2)."""


@dataclass(frozen=True)
class GoalOutcome:
    """Events of a run to a goal; frames count from the first one made for it."""

    reached: int | None  # frame at which the hips are first within 0.75 m, in 60 primitives
    near: bool  # within 0.3 m, in 60 primitives
    final_distance: float  # metres, after 60 primitives

    @property
    def steps(self) -> float:
        """Primitives until the goal was reached; NaN: never."""
        return float("nan") if self.reached is None else float(self.reached // NEW_FRAMES + 1)

    def walking(self) -> slice:
        """Frames on the way: to the goal, or all that count."""
        return slice(0, STEP_LIMIT * NEW_FRAMES if self.reached is None else self.reached)


def goal_outcome(trajectory: Trajectory) -> GoalOutcome:
    """Outcome of the goal of the last order."""
    trajectory = trajectory.latest()
    distance = distances(trajectory.hips, trajectory.goal)[: STEP_LIMIT * NEW_FRAMES]
    return GoalOutcome(
        reached=first(distance <= REACHED),
        near=bool((distance <= NEAR).any()),
        final_distance=float(distance[-1]),
    )
