"""What agents are told, as messages, and who keeps them: enough to make a motion again.

Motion depends on an agent's commands, on the chunk with which each takes effect, and, chunk by
chunk, on how many candidates there was time for.
"""

from dataclasses import dataclass
from typing import Protocol

from wayfarer.runtime.agent import AgentChange, AgentSpec, Goal
from wayfarer.runtime.behaviours import Behaviour
from wayfarer.runtime.world.handover import AgentRecord


@dataclass(frozen=True, slots=True)
class Path:
    """Visit these goals in turn.

    A goal to pass through is done once it is reached, any other once the agent has stood there for
    its dwell.
    """

    goals: tuple[Goal, ...]


@dataclass(frozen=True, slots=True)
class Append:
    """Add these goals to the end of the path; what is planned stays.

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


@dataclass(frozen=True, slots=True)
class Delete:
    """The agent is taken out of the world."""


Command = AgentSpec | AgentRecord | GoalCommand | AgentChange | Delete
"""All that agents are told: the first two create one, from nothing or as it was elsewhere."""


class Recorder(Protocol):
    """Is told of everything on the motion thread. Must neither block nor raise."""

    def command(self, agent_id: str, command: Command, seq: int) -> None:
        """`seq` is of the first chunk that it counts for.

        Goal commands count from the planning of that chunk on, `AgentChange` from its sending on.
        """
        ...

    def planned(self, agent_id: str, seq: int, candidates: int, model: str) -> None:
        """A chunk has been planned. One of this `seq` from before has been thrown away.

        `model` is the stamp of the one that moves the agent. A chunk that was held has tried 0
        candidates.
        """
        ...
