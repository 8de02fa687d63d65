"""The command log of a session: all that its motion depended on.

An agent's motion follows from its start, from what it was told and the chunk with which each
command took effect, and from how many candidates were tried for each chunk. Agents do not depend on
each other, so each has a track of its own. Chunks are many and alike: they are kept as runs.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

from wayfarer.errors import FailedPrecondition
from wayfarer.runtime.agent import AgentChange, AgentInfo, AgentSpec, SessionSpec
from wayfarer.runtime.behaviours import Patrol, Routine, Visit
from wayfarer.runtime.commands import Append, Command, Delete, GoalCommand, Path
from wayfarer.runtime.world.handover import AgentRecord
from wayfarer.runtime.world.views import Due
from wayfarer.spec import STEP_SECONDS

SAME_TIME: Final = 1e-6
"""Seconds: chunks that far from their schedule are on it, but for rounding."""

Told = GoalCommand | AgentChange


@dataclass(frozen=True, slots=True)
class Entry:
    """A command, and the first chunk that it counts for."""

    seq: int
    command: Told


@dataclass(frozen=True, slots=True)
class Run:
    """Chunks from `first` on, up to the next run, were made alike."""

    first: int
    candidates: int  # 0: held
    model: str  # its stamp; see models.py
    replanned: bool = False  # in place of one that had been planned and was thrown away


@dataclass(frozen=True, slots=True)
class Schedule:
    """Chunk `first` was to be shown at that time, and those after it each 0.2 s later."""

    first: int
    at: float  # Unix seconds

    def time(self, seq: int) -> float:
        """When a chunk was to be shown."""
        return self.at + (seq - self.first) * STEP_SECONDS


@dataclass(slots=True)
class Track:
    """What became of one agent. Chunks before `end` were sent; what counts is theirs."""

    agent_id: str
    alias: int
    created_at: float  # Unix seconds
    start: AgentSpec | AgentRecord
    entries: list[Entry] = field(default_factory=list)
    runs: list[Run] = field(default_factory=list)
    schedules: list[Schedule] = field(default_factory=list)
    planned: int = 0  # = seq of the next chunk to plan
    end: int = 0  # = seq of the next chunk to send

    def copy(self) -> "Track":
        """A track that does not change any more."""
        return replace(
            self,
            entries=self.entries.copy(),
            runs=self.runs.copy(),
            schedules=self.schedules.copy(),
        )

    def plan(self, run: Run) -> int:
        """A chunk was planned; returns by how many runs the track has grown."""
        before = len(self.runs)
        again = run.first < self.planned
        self.planned = run.first + 1
        while self.runs and self.runs[-1].first >= run.first:
            self.runs.pop()
        run = replace(run, replanned=again)
        last = self.runs[-1] if self.runs else None
        if last is None or replace(last, first=run.first) != run:
            self.runs.append(run)
        return len(self.runs) - before

    def send(self, seq: int, at: float) -> int:
        """A chunk was sent, to be shown `at`; returns by how many schedules the track has grown."""
        self.end = seq + 1
        kept = self.schedules[-1].time(seq) if self.schedules else float("inf")
        if abs(kept - at) <= SAME_TIME:
            return 0
        self.schedules.append(Schedule(seq, at))
        return 1


@dataclass(slots=True)
class CommandLog:
    """A recorded session; tracks in order of creation, those of deleted agents included."""

    session_id: str
    spec: SessionSpec
    created_at: float
    tracks: dict[str, Track] = field(default_factory=dict)
    size: int = 0  # entries, goals in them, runs and schedules
    overflowed: bool = False


class CommandLogs:
    """The logs of a world's recorded sessions. Implements `Recorder`; lives on its thread."""

    def __init__(self, limit: int, agent: Callable[[str], AgentInfo]) -> None:
        """Each log has up to `limit` entries; `agent(agent_id)` is the world's."""
        self._limit = limit
        self._agent = agent
        self._logs: dict[str, CommandLog] = {}
        self._tracks: dict[str, tuple[CommandLog, Track]] = {}  # of agents that live

    def open(self, session_id: str, spec: SessionSpec, created_at: float) -> None:
        """Begin the log of a session, if it asks for one; before its agents are there."""
        if spec.record:
            self._logs[session_id] = CommandLog(session_id, spec, created_at)

    def close(self, session_id: str) -> None:
        """The session is gone."""
        self._logs.pop(session_id, None)

    def copy(self, session_id: str) -> CommandLog:
        """A log as it is now, which does not change any more.

        Raises FailedPrecondition when the session is not recorded, or not any more.
        """
        log = self._logs.get(session_id)
        if log is None:
            raise FailedPrecondition(
                f"session {session_id!r} is not recorded; create it with `record` to have a log"
            )
        if log.overflowed:
            raise FailedPrecondition(
                f"the log of session {session_id!r} was given up: it has outgrown "
                f"limits.log_entries, {self._limit}"
            )
        return replace(log, tracks={name: track.copy() for name, track in log.tracks.items()})

    def command(self, agent_id: str, command: Command, seq: int) -> None:
        """See `Recorder`."""
        if isinstance(command, AgentSpec | AgentRecord):
            self._begin(self._agent(agent_id), command, seq)
        elif found := self._tracks.get(agent_id):
            log, track = found
            if isinstance(command, Delete):
                del self._tracks[agent_id]
            else:
                track.entries.append(Entry(seq, command))
                self._grow(log, cost(command))

    def planned(self, agent_id: str, seq: int, candidates: int, model: str) -> None:
        """See `Recorder`."""
        if found := self._tracks.get(agent_id):
            log, track = found
            self._grow(log, track.plan(Run(seq, candidates, model)))

    def sent(self, due: Due) -> None:
        """Chunks have left."""
        if due.session_id not in self._logs:
            return
        chunks = due.chunks
        for agent_id, seq, at in zip(
            chunks.agent_id, chunks.seq.tolist(), chunks.scheduled_at.tolist(), strict=True
        ):
            if found := self._tracks.get(agent_id):
                log, track = found
                self._grow(log, track.send(seq, at))

    def _begin(self, agent: AgentInfo, start: AgentSpec | AgentRecord, seq: int) -> None:
        log = self._logs.get(agent.session_id)
        if log is None or log.overflowed:
            return
        track = Track(agent.agent_id, agent.alias, agent.created_at, start, planned=seq, end=seq)
        log.tracks[agent.agent_id] = track
        self._tracks[agent.agent_id] = log, track
        self._grow(log, 1)

    def _grow(self, log: CommandLog, entries: int) -> None:
        log.size += entries
        if log.size > self._limit and not log.overflowed:
            log.overflowed = True
            for agent_id in log.tracks:
                self._tracks.pop(agent_id, None)
            log.tracks.clear()


def cost(command: Told) -> int:
    """How many entries a command counts for: as many as it has goals."""
    match command:
        case Path(goals) | Append(goals) | Patrol(goals):
            return len(goals)
        case Routine(parts):
            goals_of = [p.does.goals for p in parts if isinstance(p.does, Visit | Patrol)]
            return len(parts) + sum(map(len, goals_of))
        case _:
            return 1
