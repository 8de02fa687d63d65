"""Patrolling: goals in turn, repeatedly."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from wayfarer.config.limits import Limits
from wayfarer.world.agents.behaviour import BehavingAgent, Behaviour, Start
from wayfarer.world.agents.goal import Goal, check_goal, check_path


@dataclass(frozen=True, slots=True)
class Patrol(Behaviour):
    """Visiting goals repeatedly."""

    goals: tuple[Goal, ...]
    to_and_fro: bool = False  # back the same way; otherwise straight from the last to the first
    kind: Literal["patrol"] = "patrol"

    WALKS: ClassVar[bool] = True
    FROM_PLACE_TO_PLACE: ClassVar[bool] = True

    @property
    def given_goals(self) -> tuple[Goal, ...]:
        """The goals of a round."""
        return self.goals

    def check(self, start: Start, limits: Limits, where: str) -> None:
        """Implements `Behaviour`."""
        first = start or (self.goals[0].position if self.goals else (0.0, 0.0, 0.0))
        check_path(self.goals, first, limits, field=f"{where}.goals")
        whence = "the last goal, after which it comes,"
        check_goal(self.goals[0], self.goals[-1].position, limits, f"{where}.goals[0]", whence)

    def next_goal(self, actor: BehavingAgent, number: int) -> Goal:
        """Implements `Behaviour`."""
        step = number - actor.agent.begun
        return self.goals[patrolled(step, len(self.goals), self.to_and_fro)]


def patrolled(step: int, count: int, to_and_fro: bool) -> int:
    """The index, among `count` goals, of step `step` of a patrol."""
    if not to_and_fro or count == 1:
        return step % count
    turn = step % (2 * count - 2)
    return min(turn, 2 * count - 2 - turn)
