"""Goal commands, as plain frozen messages in world space."""

from dataclasses import dataclass

from wayfarer.world.agents.behaviour import Behaviour
from wayfarer.world.agents.goal import Goal


@dataclass(frozen=True, slots=True)
class Path:
    """Visit these goals in turn.

    A goal to pass through is done once it is reached, and any other goal after its dwell.
    """

    goals: tuple[Goal, ...]


@dataclass(frozen=True, slots=True)
class Append:
    """Add these goals to the end of the path; plans stay.

    The goals of the path keep their numbers. An agent without a path starts one; an agent that
    follows a behaviour continues with these goals after its present one.
    """

    goals: tuple[Goal, ...]


@dataclass(frozen=True, slots=True)
class Stop:
    """Stop where the agent is."""


GoalCommand = Goal | Path | Append | Behaviour | Stop
"""The commands to an agent. Each makes a revision; all but `Append` replace the former command."""
