"""Goal commands, as plain frozen messages in world space."""

from dataclasses import dataclass

from wayfarer.world.agents.behaviour import Behaviour
from wayfarer.world.agents.goal import Goal


@dataclass(frozen=True, slots=True)
class Path:
    """Visit these goals in turn.

    A goal to pass through is done once it is reached, any other once the agent has stood there for
    its dwell.
    """

    goals: tuple[Goal, ...]


@dataclass(frozen=True, slots=True)
class Append:
    """Adds these goals to the end of the path; plans stay.

    The goals of the path keep their numbers. An agent without a path starts one; an agent that
    follows a behaviour goes on with these goals after its present one.
    """

    goals: tuple[Goal, ...]


@dataclass(frozen=True, slots=True)
class Stop:
    """Stop where the agent is."""


GoalCommand = Goal | Path | Append | Behaviour | Stop
"""What an agent is to do from now on. Each command makes a revision; each but `Append` replaces
what was there."""
