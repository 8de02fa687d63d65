"""What a world reports to those that keep its history: the journal and the recordings."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from wayfarer.world.agents.agent import AgentChange, AgentSpec, AgentState
from wayfarer.world.agents.records import AgentRecord
from wayfarer.world.agents.registry import Agent, Session
from wayfarer.world.goals.commands import GoalCommand
from wayfarer.world.rows import Index
from wayfarer.world.stepping.due import Due

Names = NDArray[np.object_]

Start = AgentSpec | AgentRecord
"""What an agent starts from: nothing but a spec, or where it was elsewhere."""


@dataclass(frozen=True, slots=True)
class Fall:
    """What the guard saw of a planned chunk, in whose place the agent gets up."""

    agent_id: str
    seq: int
    state: AgentState  # of the step
    lean: float  # radians of the spine at its end; NaN, as `hips`: the step could not be shown
    hips: float  # their height, as a share of what it is in a stand


class WorldObserver(Protocol):
    """Called on the world's thread, after each change. Must neither block nor raise.

    `seq` is the number of the first chunk that a change counts for: a command counts from the
    planning of that chunk on, a change of an agent from its sending on.
    """

    def opened(self, session: Session) -> None:
        """A session is there, still without agents."""
        ...

    def closed(self, session: Session) -> None:
        """A session is gone; its agents were deleted before."""
        ...

    def created(self, session: Session, agents: Sequence[Agent], starts: Sequence[Start]) -> None:
        """Agents are new, each with what it starts from."""
        ...

    def commanded(self, agent: Agent, command: GoalCommand, seq: int) -> None:
        """A goal command was carried out; goals are those that the scene lets the agent reach."""
        ...

    def changed(self, agent: Agent, change: AgentChange, seq: int) -> None:
        """An agent was changed."""
        ...

    def deleted(self, agent: Agent, seq: int) -> None:
        """An agent is about to be removed. Its chunks from `seq` on are not sent."""
        ...

    def planned(
        self, agent_ids: Names, seqs: Index, candidates: int, models: Sequence[str]
    ) -> None:
        """A chunk of each of these agents was planned with `candidates` candidates; 0: it was held.

        `models` are the stamps of the models that move them. A chunk of the same number that was
        planned before is void.
        """
        ...

    def fell(self, falls: Sequence[Fall]) -> None:
        """Agents get up in the course of the chunks that are planned next."""
        ...

    def sent(self, due: Due) -> None:
        """Chunks of a session were taken to be sent."""
        ...

    def stood(self, agents: Sequence[Agent]) -> None:
        """These agents may have moved since they were last reported; see `World.checkpoint`."""
        ...
