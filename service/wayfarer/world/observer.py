"""Reports of a world to the keepers of its history: the journal and the recordings."""

import contextlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import acos

import numpy as np
from numpy.typing import NDArray

from wayfarer.engines.models import LoadedModels
from wayfarer.world.agents.agent import AgentChange, AgentSpec, AgentState
from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.faults import Faults, Stage
from wayfarer.world.agents.records import AgentRecord
from wayfarer.world.agents.registry import Session
from wayfarer.world.agents.slots import Mode, Slots
from wayfarer.world.goals.commands import GoalCommand
from wayfarer.world.rows import Float, Index, Int8
from wayfarer.world.stepping.due import Due

Names = NDArray[np.object_]

Start = AgentSpec | AgentRecord
"""The start of an agent: only a spec, or its state from another server."""


@dataclass(frozen=True, slots=True)
class Fall:
    """The guard's view of a planned chunk that is replaced by getting up."""

    agent_id: str
    seq: int
    state: AgentState  # of the step
    lean: float  # radians of the spine at its end; NaN, like `hips`, if the step cannot be shown
    hips: float  # their height, relative to that in a stand


class WorldObserver:
    """Called on the world's thread, after each change. Must neither block nor raise. By default a
    report is ignored.

    `seq` is the number of the first chunk to which a change applies: a command applies from the
    planning of that chunk on, a change of an agent from its sending on.
    """

    def opened(self, session: Session) -> None:
        """A session was opened, still without agents."""

    def closed(self, session: Session) -> None:
        """A session has ended; its agents were deleted before."""

    def created(self, session: Session, agents: Sequence[Agent], starts: Sequence[Start]) -> None:
        """Agents were created, each from its start."""

    def commanded(self, agent: Agent, command: GoalCommand, seq: int) -> None:
        """A goal command was carried out, with its goals moved to reachable places."""

    def changed(self, agent: Agent, change: AgentChange, seq: int) -> None:
        """An agent was changed."""

    def deleted(self, agent: Agent, seq: int) -> None:
        """An agent is about to be removed. Its chunks from `seq` on are not sent."""

    def planned(
        self, agent_ids: Names, seqs: Index, candidates: int, models: Sequence[str]
    ) -> None:
        """A chunk of each of these agents was planned with `candidates` candidates; 0: it was held.

        `models` are the stamps of the models that move them. An earlier plan of a chunk with the
        same number is void.
        """

    def fell(self, falls: Sequence[Fall]) -> None:
        """Agents get up in the chunks that are planned next."""

    def sent(self, due: Due) -> None:
        """Chunks of a session were taken to be sent."""

    def stood(self, agents: Sequence[Agent]) -> None:
        """These agents may have moved since they were last reported; see `World.checkpoint`."""

    def strayed(self, session_id: str, agent_id: str) -> None:
        """After a fault, the agent's motion no longer follows from the reports; without an id, that
        of all agents of the session.
        """


class Observers:
    """The observers of a world. Their errors become faults of the sessions or agents concerned."""

    def __init__(self, faults: Faults, slots: Slots, models: LoadedModels) -> None:
        self._faults = faults
        self._slots = slots
        self._models = models
        self._observers: list[WorldObserver] = []

    def __bool__(self) -> bool:
        return bool(self._observers)

    def add(self, observer: WorldObserver) -> None:
        """Reports to `observer` from now on."""
        self._observers.append(observer)

    def tell(
        self,
        report: Callable[[WorldObserver], None],
        *session_ids: str,
        agent_ids: Iterable[str] = (),
    ) -> None:
        """Calls `report` with each observer. It is about these sessions and those of the agents."""
        for observer in self._observers:
            try:
                report(observer)
            except Exception as error:
                for session_id in (*session_ids, *self._faults.sessions_of(agent_ids)):
                    self._faults.session(session_id, Stage.RECORD, error)

    def planned(self, rows: Index, seqs: Index, candidates: int) -> None:
        """Reports chunks that were planned for agents; see `WorldObserver`."""
        if not self:
            return
        numbers = self._slots.model[rows].tolist()
        stamps = {number: self._models.numbered(number).stamp for number in set(numbers)}
        models = [stamps[number] for number in numbers]
        names = self._slots.agent_id[rows]
        self.tell(lambda o: o.planned(names, seqs, candidates, models), agent_ids=names)

    def fell(self, rows: Index, modes: Int8, upright: Float, hips: Float) -> None:
        """Reports agents that get up."""
        if not self:
            return
        slots = self._slots
        falls = [
            Fall(slots.agent_id[row], seq, Mode(mode).state, acos(min(cosine, 1.0)), height)
            for row, seq, mode, cosine, height in zip(
                rows.tolist(), slots.planned_chunks[rows].tolist(), modes.tolist(),
                upright.tolist(), hips.tolist(), strict=True,
            )
        ]  # fmt: skip
        names = [fall.agent_id for fall in falls]
        self.tell(lambda observer: observer.fell(falls), agent_ids=names)

    def stood(self, agents: Sequence[Agent]) -> None:
        """Reports where agents stand, except those that sit recording out."""
        rows = np.array([agent.slot for agent in agents], np.int64)
        if self._faults.any:
            kept = np.flatnonzero(~self._faults.out(rows, Stage.RECORD))
            agents, rows = [agents[row] for row in kept.tolist()], rows[kept]
        self._faults.stage = Stage.RECORD
        for observer in self._observers:

            def some_stood(some: Index, listener: WorldObserver = observer) -> None:
                listener.stood([agents[row] for row in some.tolist()])

            try:
                observer.stood(agents)
            except Exception as error:
                self._faults.split(rows, some_stood, error)

    def strayed(self, session_id: str, agent_id: str) -> None:
        """See `WorldObserver`. Errors are ignored, since it reports a fault that is known."""
        for observer in self._observers:
            with contextlib.suppress(Exception):
                observer.strayed(session_id, agent_id)
