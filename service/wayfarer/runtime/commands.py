"""What agents are told, as messages, and who keeps them: enough to make a motion again.

Motion depends on an agent's commands, on the chunk with which each takes effect, and, chunk by
chunk, on how many candidates there was time for.
"""

from dataclasses import dataclass
from typing import Protocol

from wayfarer.runtime.agent import AgentChange, AgentSpec, Goal
from wayfarer.runtime.behaviours import Behaviour, Routine
from wayfarer.runtime.world.handover import AgentRecord


@dataclass(frozen=True, slots=True)
class SetGoal:
    """Go there, in place of all before."""

    goal: Goal


@dataclass(frozen=True, slots=True)
class SetPath:
    """Visit these goals in turn, in place of all before."""

    goals: tuple[Goal, ...]


@dataclass(frozen=True, slots=True)
class AppendGoals:
    """Visit these goals, too, after those there are."""

    goals: tuple[Goal, ...]


@dataclass(frozen=True, slots=True)
class ClearGoal:
    """Stop."""


Order = SetGoal | SetPath | AppendGoals | ClearGoal | Behaviour | Routine
"""A change of what the agent does; each makes a revision."""


@dataclass(frozen=True, slots=True)
class Delete:
    """The agent is taken out of the world."""


Command = AgentSpec | AgentRecord | Order | AgentChange | Delete
"""All that agents are told: the first two create one, from nothing or as it was elsewhere."""


class Recorder(Protocol):
    """Is told of everything on the motion thread. Must neither block nor raise."""

    def command(self, agent_id: str, command: Command, seq: int) -> None:
        """`seq` is of the first chunk that it counts for.

        Orders count from the planning of that chunk on, `AgentChange` from its sending on.
        """
        ...

    def planned(self, agent_id: str, seq: int, candidates: int, model: str) -> None:
        """A chunk has been planned. One of this `seq` from before has been thrown away.

        `model` is the stamp of the one that moves the agent. A chunk that was held has tried 0
        candidates.
        """
        ...
