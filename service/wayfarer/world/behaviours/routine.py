"""Routines: one activity after the other."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal

from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument
from wayfarer.world.agents.behaviour import STAND, BehavingAgent, Behaviour, Start
from wayfarer.world.agents.goal import Goal, check_path
from wayfarer.world.behaviours.follow import Follow
from wayfarer.world.behaviours.keep_away import KeepAway
from wayfarer.world.behaviours.patrol import Patrol
from wayfarer.world.behaviours.queue import Queue
from wayfarer.world.behaviours.wander import Wander
from wayfarer.world.ranges import check_range

PARTS: Final = (1, 32)
SECONDS: Final = (0.0, 86_400.0)


@dataclass(frozen=True, slots=True)
class Visit(Behaviour):
    """Visiting goals in turn, once."""

    goals: tuple[Goal, ...]
    kind: Literal["visit"] = "visit"

    WALKS: ClassVar[bool] = True

    @property
    def given_goals(self) -> tuple[Goal, ...]:
        """Implements `Behaviour`."""
        return self.goals

    def check(self, start: Start, limits: Limits, where: str) -> None:
        """Implements `Behaviour`."""
        first = start or (self.goals[0].position if self.goals else (0.0, 0.0, 0.0))
        check_path(self.goals, first, limits, field=f"{where}.goals")

    def first_goals(self, actor: BehavingAgent, number: int) -> tuple[Goal, ...]:
        """Implements `Behaviour`."""
        return self.goals

    def is_over(self, actor: BehavingAgent) -> bool:
        """Implements `Behaviour`."""
        return actor.is_at_last_goal and actor.has_done(self.goals[-1])


@dataclass(frozen=True, slots=True)
class Stand(Behaviour):
    """Standing in place."""

    kind: Literal["stand"] = "stand"

    def update(self, actor: BehavingAgent) -> None:
        """Implements `Behaviour`."""
        actor.aim(STAND)


PartBehaviour = Visit | Stand | Wander | Patrol | Follow | KeepAway | Queue
"""The kinds that a part of a routine may have."""


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a routine."""

    does: PartBehaviour
    # then the next part begins; 0: when it is done, which only a visit can be
    seconds: Annotated[float, SECONDS] = 0.0


@dataclass(frozen=True, slots=True)
class Routine(Behaviour):
    """One activity after the other: patrol for a minute, queue for ten seconds, then go home.

    A part ends after its seconds. A visit also ends after the dwell at its last goal, and following
    and keeping away end when the other agent is deleted. After the last part the agent stands, or
    begins again.
    """

    parts: Annotated[tuple[Part, ...], PARTS]
    repeat: bool = False
    kind: Literal["routine"] = "routine"

    def check(self, start: Start, limits: Limits, where: str) -> None:
        """Implements `Behaviour`."""
        count = len(self.parts)
        if not PARTS[0] <= count <= PARTS[1]:
            raise InvalidArgument(
                f"a routine has {count} parts; allowed: {PARTS[0]} to {PARTS[1]}", f"{where}.parts"
            )
        goals = sum(len(part.does.given_goals) for part in self.parts)
        if goals > limits.path_goals:
            raise InvalidArgument(
                f"its parts have {goals} goals; allowed: {limits.path_goals} in all",
                f"{where}.parts",
            )
        for number, part in enumerate(self.parts):
            at = f"{where}.parts[{number}]"
            check_range([part.seconds], *SECONDS, f"{at}.seconds")
            part.does.check(start if number == 0 else None, limits, at)
            more = self.repeat or number < count - 1
            if more and part.seconds == 0 and not isinstance(part.does, Visit):
                raise InvalidArgument(
                    "only a visit ends by itself: give the part seconds, or let it be the last one",
                    f"{at}.seconds",
                )
