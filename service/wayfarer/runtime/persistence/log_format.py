"""A command log as bytes, and back: what ExportLog gives and Replay takes.

A container (container.py): a JSON header, and for each agent one row of raw arrays for its start,
unless that was a spec and not a place in mid-motion.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite
from typing import ClassVar, Final

import numpy as np
from pydantic import BaseModel, ConfigDict

from wayfarer.config.limits import Limits
from wayfarer.errors import FailedPrecondition, InvalidArgument
from wayfarer.runtime.persistence.container import ContainerKind, seal, unseal
from wayfarer.runtime.persistence.packing import unpack
from wayfarer.runtime.persistence.record import (
    AgentTrack,
    ChunkRun,
    CommandLog,
    LogEntry,
    Schedule,
    Told,
)
from wayfarer.runtime.persistence.snapshot import (
    AGENT_BYTES,
    GOAL_BYTES,
    SESSION_BYTES,
    AgentPart,
    AgentRows,
    BodyStamp,
    agent_part,
    check_body,
    check_origin,
    join_agent,
    pack_agent,
    parse,
)
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentChange, AgentSpec, SessionSpec
from wayfarer.world.agents.checks import check_agent_id, check_session_id, check_spec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.records import AgentRecord
from wayfarer.world.behaviours import AnyBehaviour, known_behaviour
from wayfarer.world.goals.commands import Append, Path, Stop
from wayfarer.world.record_checks import MAX_COUNT, check_agent_record

MAX_CANDIDATES: Final = 256
MAX_TIME: Final = 1e12
"""Unix seconds: no clock shows a later time."""

CHUNKS_PER_ENTRY: Final = 50
"""Upper bound of chunks per log entry: a log with more is refused."""


@dataclass(frozen=True, slots=True)
class LogOrigin:
    """The body, models and settings that a log's motion was made with, and is replayed with."""

    body: BodyStamp
    models: tuple[str, ...]  # their stamps; see models.py
    candidates: int  # the most that steering asks for


@dataclass(frozen=True, slots=True)
class EntryPart:
    """`LogEntry`; exactly one of the commands is there."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    seq: int
    set_goal: Goal | None = None
    set_path: tuple[Goal, ...] | None = None
    append_goals: tuple[Goal, ...] | None = None
    behaviour: AnyBehaviour | None = None
    clear_goal: bool | None = None
    change: AgentChange | None = None


@dataclass(frozen=True, slots=True)
class TrackPart:
    """`AgentTrack` without its arrays; exactly one of the starts is there."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    agent_id: str
    alias: int
    created_at: float
    entries: tuple[EntryPart, ...]
    runs: tuple[ChunkRun, ...]
    schedules: tuple[Schedule, ...]
    end: int
    spec: AgentSpec | None = None
    record: AgentPart | None = None
    restarts: tuple[()] = ()
    """Always empty. Servers before 2026-11-28 wrote logs with more, which are refused."""


class LogHeader(BaseModel):
    """The JSON of a log."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    fps: int
    origin: LogOrigin
    session_id: str
    spec: SessionSpec
    created_at: float
    tracks: tuple[TrackPart, ...]


def encode_log(log: CommandLog, origin: LogOrigin) -> bytes:
    """The log, as far as its chunks have been sent, and with what counts from the next one on."""
    tracks = log.tracks.values()
    header = LogHeader(
        fps=FPS,
        origin=origin,
        session_id=log.session_id,
        spec=log.spec,
        created_at=log.created_at,
        tracks=tuple(map(_track_part, tracks)),
    )
    text = header.model_dump_json(exclude_none=True)
    return seal(ContainerKind.LOG, text.encode(), b"".join(map(pack_agent, _poses(tracks))))


def decode_log(data: bytes, origin: LogOrigin, limits: Limits, most_entries: int) -> CommandLog:
    """A log that anybody may have made, with up to `most_entries`.

    Raises InvalidArgument that names what is wrong, FailedPrecondition when it is sound but was
    made with another model, body or format.
    """
    most = SESSION_BYTES + most_entries * (GOAL_BYTES + AGENT_BYTES // 64)
    text, arrays = unseal(ContainerKind.LOG, data, most)
    header = parse(LogHeader, text, ContainerKind.LOG, values=32 * most_entries)
    _check_origin(header, origin)
    check_session_id(header.session_id)
    log = CommandLog(header.session_id, header.spec, header.created_at)
    rows = _rows(arrays)
    for number, part in enumerate(header.tracks):
        track = _track(part, rows, limits, f"tracks[{number}]")
        if track.agent_id in log.tracks:
            raise InvalidArgument("is there twice", f"tracks[{number}].agent_id")
        log.tracks[track.agent_id] = track
        log.size += track.size
    if next(rows, None) is not None:
        raise InvalidArgument("log has the motion of more agents than it names", "log")
    _check_size(log, most_entries)
    return log


# Logs to parts


def _poses(tracks: Iterable[AgentTrack]) -> list[AgentRecord]:
    """The objects with rows in the arrays, in their order."""
    return [track.start for track in tracks if isinstance(track.start, AgentRecord)]


def _track_part(track: AgentTrack) -> TrackPart:
    start = track.start
    return TrackPart(
        agent_id=track.agent_id,
        alias=track.alias,
        created_at=track.created_at,
        entries=tuple(_entry_part(e) for e in track.entries if e.seq <= track.end),
        runs=tuple(run for run in track.runs if run.first < track.end),
        schedules=tuple(track.schedules),
        end=track.end,
        spec=start if isinstance(start, AgentSpec) else None,
        record=agent_part(start) if isinstance(start, AgentRecord) else None,
    )


def _entry_part(entry: LogEntry) -> EntryPart:
    match entry.command:
        case Goal() as goal:
            return EntryPart(entry.seq, set_goal=goal)
        case Path(goals):
            return EntryPart(entry.seq, set_path=goals)
        case Append(goals):
            return EntryPart(entry.seq, append_goals=goals)
        case Stop():
            return EntryPart(entry.seq, clear_goal=True)
        case AgentChange() as change:
            return EntryPart(entry.seq, change=change)
        case behaviour:
            return EntryPart(entry.seq, behaviour=known_behaviour(behaviour))


# And back


def _rows(arrays: bytes) -> Iterator[AgentRows]:
    rows = unpack(AgentRows, arrays, "log")
    for number in range(len(rows.seq)):
        yield rows.take(np.array([number]))


def _track(part: TrackPart, rows: Iterator[AgentRows], limits: Limits, where: str) -> AgentTrack:
    check_agent_id(part.agent_id, f"{where}.agent_id")
    start = _start(part, rows, limits, where)
    first = start.seq if isinstance(start, AgentRecord) else 0
    _require(0 < part.alias < MAX_COUNT, where, "alias")
    _require(isfinite(part.created_at), where, "created_at")
    _require(first <= part.end < MAX_COUNT, where, "end")
    _check_seqs([run.first for run in part.runs], first, part.end, where, "runs")
    _check_seqs([s.first for s in part.schedules], first, part.end, where, "schedules")
    _require(all(0 <= r.candidates <= MAX_CANDIDATES for r in part.runs), where, "runs")
    _require(
        all(isfinite(s.at) and abs(s.at) < MAX_TIME for s in part.schedules), where, "schedules"
    )
    _require(all(first <= e.seq <= part.end for e in part.entries), where, "entries")
    return AgentTrack(
        agent_id=part.agent_id,
        alias=part.alias,
        created_at=part.created_at,
        start=start,
        entries=[_entry(entry, where) for entry in part.entries],
        runs=list(part.runs),
        schedules=list(part.schedules),
        planned=part.end,
        end=part.end,
    )


def _start(
    part: TrackPart, rows: Iterator[AgentRows], limits: Limits, where: str
) -> AgentSpec | AgentRecord:
    match part.spec, part.record:
        case AgentSpec() as spec, None:
            check_spec(spec, f"{where}.spec")
            return spec
        case None, AgentPart() as kept:
            row = next(rows, None)
            if row is None:
                raise InvalidArgument("log has no motion for it to start from", f"{where}.record")
            record = join_agent(kept, row)
            check_agent_record(record, limits, f"{where}.record")
            check_body(record, f"{where}.record")
            return record
        case _:
            raise InvalidArgument("needs a spec or a record to start from, and not both", where)


def _entry(part: EntryPart, where: str) -> LogEntry:
    given: list[Told] = []
    if part.set_goal is not None:
        given.append(part.set_goal)
    if part.set_path is not None:
        given.append(Path(part.set_path))
    if part.append_goals is not None:
        given.append(Append(part.append_goals))
    if part.clear_goal:
        given.append(Stop())
    given += [told for told in (part.behaviour, part.change) if told is not None]
    if len(given) != 1:
        raise InvalidArgument(f"an entry holds {len(given)} commands; allowed: 1", where)
    return LogEntry(part.seq, given[0])


# Checks


def _check_origin(header: LogHeader, origin: LogOrigin) -> None:
    check_origin(header.fps, header.origin.body, origin.body, ContainerKind.LOG)
    made, here = header.origin, origin
    used = {run.model for track in header.tracks for run in track.runs}
    if missing := used - set(here.models):
        raise FailedPrecondition(
            f"log was made with model {', '.join(sorted(missing))}; loaded here are "
            f"{', '.join(here.models)}, which would make other motion"
        )
    if made.candidates != here.candidates:
        raise FailedPrecondition(
            f"log was made with `candidates` {made.candidates}; this server has {here.candidates}"
        )


def _check_seqs(seqs: Sequence[int], first: int, end: int, where: str, name: str) -> None:
    """They begin with the first chunk, if there is one, and ascend."""
    begins = seqs[0] == first if seqs else first == end
    ascends = all(a < b for a, b in pairwise(seqs))
    _require(begins and ascends and (not seqs or seqs[-1] < end), where, name)


def _check_size(log: CommandLog, most_entries: int) -> None:
    if log.size > most_entries:
        raise InvalidArgument(f"log has {log.size} entries; allowed: {most_entries}", "log")
    chunks = sum(track.end - track.runs[0].first for track in log.tracks.values() if track.runs)
    if chunks > CHUNKS_PER_ENTRY * most_entries:
        raise InvalidArgument(
            f"log has {chunks} chunks; allowed: {CHUNKS_PER_ENTRY * most_entries}", "log"
        )


def _require(holds: bool, where: str, name: str) -> None:
    if not holds:
        raise InvalidArgument(f"{where}.{name} is out of range or out of order", f"{where}.{name}")
