"""The command log of a session: everything that its motion depended on.

An agent's motion follows from its start, from its commands and the chunk at which each took
effect, and from the number of candidates for each chunk. Agents do not depend on each other, so
each has its own track. Most chunks are alike, so they are stored as runs.
"""

from bisect import bisect_left, insort_right
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Final

from wayfarer.errors import FailedPrecondition
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import AgentChange, SessionSpec
from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.records import AgentRecord
from wayfarer.world.agents.registry import Session
from wayfarer.world.behaviours import Behaviour, Routine
from wayfarer.world.goals.commands import Append, GoalCommand, Path
from wayfarer.world.observer import Names, Start, WorldObserver
from wayfarer.world.rows import Index
from wayfarer.world.stepping.due import Due

SAME_TIME: Final = 1e-6
"""Seconds: chunks within this of their schedule are on time, except for rounding."""

Told = GoalCommand | AgentChange


@dataclass(frozen=True, slots=True)
class LogEntry:
    """A command, and the first chunk that it counts for."""

    seq: int
    command: Told


@dataclass(frozen=True, slots=True)
class ChunkRun:
    """Chunks from `first` on, up to the next run, were made alike."""

    first: int
    candidates: int  # 0: held
    model: str  # its stamp; see models.py
    replanned: bool = False  # replaces a planned chunk that was discarded


@dataclass(frozen=True, slots=True)
class Schedule:
    """Chunk `first` was due at that time, and each later chunk 0.2 s after the one before."""

    first: int
    at: float  # Unix seconds

    def time(self, seq: int) -> float:
        """The time at which a chunk was due."""
        return self.at + (seq - self.first) * STEP_SECONDS


@dataclass(slots=True)
class AgentTrack:
    """What became of one agent. Chunks before `end` were sent; what counts is theirs.

    Entries, runs and schedules ascend by their chunks, and those before `end` do not change.
    """

    agent_id: str
    alias: int
    created_at: float  # Unix seconds
    start: Start
    entries: list[LogEntry] = field(default_factory=list)
    runs: list[ChunkRun] = field(default_factory=list)
    schedules: list[Schedule] = field(default_factory=list)
    planned: int = 0  # = seq of the next chunk to plan
    end: int = 0  # = seq of the next chunk to send

    @property
    def first(self) -> int:
        """Number of its first chunk."""
        return self.start.seq if isinstance(self.start, AgentRecord) else 0

    @property
    def size(self) -> int:
        """Entries that it takes of a log."""
        commands = sum(cost(entry.command) for entry in self.entries)
        return 1 + commands + len(self.runs) + len(self.schedules)

    def copy(self) -> "AgentTrack":
        """A track that does not change any more."""
        return replace(
            self,
            entries=self.entries.copy(),
            runs=self.runs.copy(),
            schedules=self.schedules.copy(),
        )

    def enter(self, entry: LogEntry) -> None:
        """Adds an order. It may discard the chunk from which earlier orders counted: then
        these count from the same chunk as the new one.
        """
        if not isinstance(entry.command, AgentChange):
            later = bisect_left(self.entries, entry.seq + 1, key=_SEQ)
            for place in range(later, len(self.entries)):
                self.entries[place] = replace(self.entries[place], seq=entry.seq)
        insort_right(self.entries, entry, key=_SEQ)

    def plan(self, run: ChunkRun) -> int:
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


_SEQ: Final = attrgetter("seq")


@dataclass(slots=True)
class CommandLog:
    """A recorded session; tracks in order of creation, those of deleted agents included."""

    session_id: str
    spec: SessionSpec
    created_at: float
    tracks: dict[str, AgentTrack] = field(default_factory=dict)
    size: int = 0  # entries, goals in them, runs and schedules
    overflowed: bool = False


class Recordings(WorldObserver):
    """The logs of recorded sessions, of any number of worlds.

    A log belongs to one session, and so to the thread of its world.
    """

    def __init__(self, limit: int) -> None:
        """Each log has up to `limit` entries."""
        self._limit = limit
        self._logs: dict[str, CommandLog] = {}
        self._tracks: dict[str, tuple[CommandLog, AgentTrack]] = {}  # of agents that live

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
                f"the log of session {session_id!r} was dropped: it has outgrown "
                f"limits.log_entries, {self._limit}"
            )
        return replace(log, tracks={name: track.copy() for name, track in log.tracks.items()})

    def go_on(self, log: CommandLog | None, session_id: str) -> None:
        """Continues the log of a session from another server; None: it was dropped."""
        begun = self._logs[session_id]
        if log is None:
            self._drop(begun)
            return
        for name, track in begun.tracks.items():
            kept = log.tracks.setdefault(name, track)
            if name in self._tracks:
                self._tracks[name] = log, kept
        self._logs[session_id] = log
        log.size = sum(track.size for track in log.tracks.values())
        self._grow(log, 0)

    # As a `WorldObserver`

    def opened(self, session: Session) -> None:
        """Begins the log of a session, if it asks for one."""
        if session.spec.record:
            session_id = session.session_id
            self._logs[session_id] = CommandLog(session_id, session.spec, session.created_at)

    def closed(self, session: Session) -> None:
        """Forgets the log."""
        self._logs.pop(session.session_id, None)

    def created(self, session: Session, agents: Sequence[Agent], starts: Sequence[Start]) -> None:
        """Begins a track for each agent."""
        log = self._logs.get(session.session_id)
        for agent, start in zip(agents, starts, strict=True):
            if log is not None and not log.overflowed:
                self._begin(log, agent, start)

    def commanded(self, agent: Agent, command: GoalCommand, seq: int) -> None:
        """Notes a goal command."""
        self._enter(agent, LogEntry(seq, command))

    def changed(self, agent: Agent, change: AgentChange, seq: int) -> None:
        """Notes a change."""
        self._enter(agent, LogEntry(seq, change))

    def deleted(self, agent: Agent, seq: int) -> None:
        """The track is complete."""
        self._tracks.pop(agent.agent_id, None)

    def planned(
        self, agent_ids: Names, seqs: Index, candidates: int, models: Sequence[str]
    ) -> None:
        """Notes how many candidates were tried."""
        for agent_id, seq, model in zip(agent_ids, seqs.tolist(), models, strict=True):
            if found := self._tracks.get(agent_id):
                log, track = found
                self._grow(log, track.plan(ChunkRun(seq, candidates, model)))

    def strayed(self, session_id: str, agent_id: str) -> None:
        """Their tracks end here: what follows could not be played again."""
        log = self._logs.get(session_id)
        if log is not None:
            for name in (agent_id,) if agent_id else tuple(log.tracks):
                self._tracks.pop(name, None)

    def sent(self, due: Due) -> None:
        """Notes when chunks are shown."""
        if due.session_id not in self._logs:
            return
        chunks = due.chunks
        for agent_id, seq, at in zip(
            chunks.agent_id, chunks.seq.tolist(), chunks.scheduled_at.tolist(), strict=True
        ):
            if found := self._tracks.get(agent_id):
                log, track = found
                self._grow(log, track.send(seq, at))

    def _enter(self, agent: Agent, entry: LogEntry) -> None:
        if found := self._tracks.get(agent.agent_id):
            log, track = found
            track.enter(entry)
            self._grow(log, cost(entry.command))

    def _begin(self, log: CommandLog, agent: Agent, start: Start) -> None:
        seq = start.seq if isinstance(start, AgentRecord) else 0
        track = AgentTrack(
            agent.agent_id, agent.alias, agent.created_at, start, planned=seq, end=seq
        )
        log.tracks[agent.agent_id] = track
        self._tracks[agent.agent_id] = log, track
        self._grow(log, 1)

    def _grow(self, log: CommandLog, entries: int) -> None:
        log.size += entries
        if log.size > self._limit and not log.overflowed:
            self._drop(log)

    def _drop(self, log: CommandLog) -> None:
        log.overflowed = True
        for agent_id in log.tracks:
            self._tracks.pop(agent_id, None)
        log.tracks.clear()


def cost(command: Told) -> int:
    """How many entries a command counts for: as many as it has goals."""
    match command:
        case Path(goals) | Append(goals):
            return len(goals)
        case Routine(parts):
            return len(parts) + sum(len(part.does.given_goals) for part in parts)
        case Behaviour() as behaviour:
            return len(behaviour.given_goals) or 1
        case _:
            return 1
