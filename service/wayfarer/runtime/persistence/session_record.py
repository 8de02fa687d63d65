"""A session as bytes: one record, with optional parts.

A container (container.py): a JSON header, which pydantic validates, then for each agent one row of
raw arrays. That much is a *snapshot*, which clients export and import (snapshot.py). A *copy*, for
when this server dies, has the session's crowd, if there is one. A session that *moves* also has
when its next chunks are due, the last seconds of publications for streams that resume, and the log
of a recorded session; another server resumes it exactly. Copies and moves pass between
servers only, and are checked nevertheless.
"""

from dataclasses import dataclass, fields
from itertools import accumulate, pairwise
from typing import Annotated, ClassVar, Final, NamedTuple

import numpy as np
from pydantic import ConfigDict, Field

from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument
from wayfarer.runtime.persistence.container import LEVEL, ContainerKind, seal
from wayfarer.runtime.persistence.journal_entries import CapturedAgents
from wayfarer.runtime.persistence.packing import pack, row_bytes, unpack
from wayfarer.runtime.persistence.snapshot import (
    AGENT_BYTES,
    SESSION_BYTES,
    AgentRows,
    BodyStamp,
    SessionPart,
    SnapshotHeader,
    join_agents,
    join_session,
    most_bytes,
    most_values,
    open_snapshot,
)
from wayfarer.runtime.streams.publications import Publication
from wayfarer.runtime.streams.publisher import SessionLog
from wayfarer.runtime.streams.subscription import KeptPublication, QueuedPublication
from wayfarer.spec import FPS, NEW_FRAMES, POSED_JOINTS
from wayfarer.world.agents.agent import MotionChunks
from wayfarer.world.agents.records import LiveRows, SessionRecord
from wayfarer.world.events import Event
from wayfarer.world.rows import Double, Flags, Float, Int, Int8, Int16, Rows, Shape, UInt8
from wayfarer.world.scenes.populate import CrowdPeople

RING_BYTES: Final = 8 << 20
"""Bytes of publications that go along, the latest; a stream that resumes before them has a gap."""

MAX_COUNT: Final = 2**53
STORED: Final = 0  # zlib's level: large parts are compressed already, or are poses


@dataclass(slots=True, eq=False)
class _ChunkRows(Rows):
    """`MotionChunks` without the ids."""

    alias: Int
    seq: Int
    first_frame: Int
    scheduled_at: Double
    goal_revision: Int
    flags: UInt8
    state: Int8
    translation: Annotated[Float, Shape(NEW_FRAMES, 3)]
    rotations: Annotated[Float, Shape(NEW_FRAMES, POSED_JOINTS, 4)]
    contacts: Annotated[Flags, Shape(NEW_FRAMES, 2)]
    waypoint: Int
    candidates: Int16


Count = Annotated[int, Field(ge=0, lt=MAX_COUNT)]


@dataclass(frozen=True, slots=True)
class _PublicationPart:
    """A publication without its chunks."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    position: Count
    motion: float
    chunks: Count
    events: tuple[Event, ...]


@dataclass(frozen=True, slots=True)
class _LogPart:
    """`SessionLog` without its chunks."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    epoch: Annotated[str, Field(pattern=r"^[A-Za-z0-9-]{1,40}$")]
    position: Count
    motion: float
    last_at: float | None
    stopping: dict[str, tuple[int, int]]
    names: dict[int, str]  # of the agents in the publications, by alias
    publications: tuple[_PublicationPart, ...]


class _Header(SnapshotHeader):
    """The JSON: that of a snapshot, with optional parts."""

    model_config = ConfigDict(extra="forbid", frozen=True, ser_json_inf_nan="strings")

    crowd: CrowdPeople | None = None
    log: _LogPart | None = None  # its arrays follow the agents', then the recording


@dataclass(frozen=True, slots=True)
class SessionCopy:
    """A session of another server."""

    record: SessionRecord
    rows: LiveRows | None = None  # of its agents, in order; present in a move, as `log` is
    log: SessionLog | None = None
    crowd: CrowdPeople | None = None
    recording: bytes = b""  # as `ExportLog` gives it; empty: it is not recorded


class CapturedSession(NamedTuple):
    """The state of a session in its world and streams, all of one moment."""

    part: SessionPart
    agents: CapturedAgents
    crowd: CrowdPeople | None = None
    rows: LiveRows | None = None  # with `log`: it is frozen, to be moved
    log: SessionLog | None = None


def encode_record(taken: CapturedSession, body: BodyStamp, recording: bytes = b"") -> bytes:
    """The container."""
    arrays, log = [pack(taken.agents.rows).tobytes()], None
    if taken.log is not None and taken.rows is not None:
        log, chunks = _log_part(taken.log)
        arrays += [pack(rows).tobytes() for rows in (taken.rows, *map(_rows_of, chunks))]
        arrays.append(recording)
    agents = tuple(member.part for member in taken.agents.members)
    header = _Header(
        fps=FPS, body=body, session=taken.part, agents=agents, crowd=taken.crowd, log=log
    )
    absent = {name for name in ("crowd", "log") if getattr(header, name) is None}
    text = header.model_dump_json(exclude=absent).encode()
    return seal(ContainerKind.SNAPSHOT, text, b"".join(arrays), STORED if log else LEVEL)


def decode_record(data: bytes, body: BodyStamp, limits: Limits) -> SessionCopy:
    """Raises InvalidArgument, FailedPrecondition."""
    values = 10_000 + limits.agents_per_session * 68 + most_values(limits)
    header, arrays = open_snapshot(_Header, data, body, most_record_bytes(limits), values)
    count, log = len(header.agents), header.log
    sizes = list[int]()  # of all but the last part
    if log is not None:
        made = sum(one.chunks for one in log.publications)
        kinds = (count, AgentRows), (count, LiveRows), (made, _ChunkRows)
        sizes += [number * row_bytes(kind) for number, kind in kinds]
    bounds = [0, *accumulate(sizes), len(arrays)]
    parts = [arrays[start:end] for start, end in pairwise(bounds)]
    record = join_session(header.session, join_agents(header.agents, parts[0], limits), limits)
    if log is None:
        return SessionCopy(record, crowd=header.crowd)
    rows = unpack(LiveRows, parts[1], "rows")
    if len(rows.shown_at) != count:
        raise InvalidArgument("has the rows of other agents", "rows")
    chunks = unpack(_ChunkRows, parts[2], "chunks")
    return SessionCopy(record, rows, _log(log, chunks), header.crowd, recording=parts[3])


def most_record_bytes(limits: Limits) -> int:
    """Upper bound of a session that this server accepts from another."""
    log_bytes = SESSION_BYTES + limits.log_entries * (AGENT_BYTES // 64)
    return 2 * most_bytes(limits) + RING_BYTES + row_bytes(_ChunkRows) + log_bytes


def _log_part(log: SessionLog) -> tuple[_LogPart, list[MotionChunks]]:
    """The log with the publications that fit into `RING_BYTES`, and their chunks."""
    room, kept = RING_BYTES // row_bytes(_ChunkRows), list[QueuedPublication]()
    for one in reversed(log.held):
        room -= len(one.publication.chunks)
        if room < 0:
            break
        kept.append(one.whole)
    kept.reverse()
    chunks = [one.publication.chunks for one in kept if one.publication.chunks]
    part = _LogPart(
        epoch=log.epoch,
        position=log.position,
        motion=log.motion,
        last_at=log.last_at,
        stopping=dict(log.stopping),
        names={a: n for c in chunks for a, n in zip(c.alias.tolist(), c.agent_id, strict=True)},
        publications=tuple(
            _PublicationPart(
                one.publication.position,
                one.motion,
                len(one.publication.chunks),
                one.publication.events,
            )
            for one in kept
        ),
    )
    return part, chunks


def _rows_of(chunks: MotionChunks) -> _ChunkRows:
    return _ChunkRows(**{one.name: getattr(chunks, one.name) for one in fields(_ChunkRows)})


def _log(part: _LogPart, rows: _ChunkRows) -> SessionLog:
    columns = {one.name: getattr(rows, one.name) for one in fields(_ChunkRows)}
    try:
        names = [part.names[alias] for alias in rows.alias.tolist()]
    except KeyError as error:
        raise InvalidArgument(f"nothing says which agent {error} is", "log.names") from None
    agent_ids = np.empty(len(names), np.object_)
    agent_ids[:] = names
    every = MotionChunks(agent_id=agent_ids, **columns)
    held, row = list[KeptPublication](), 0
    for one in part.publications:
        chunks = every.take(np.arange(row, row + one.chunks))
        row += one.chunks
        publication = Publication(one.position, chunks, one.events)
        held.append(KeptPublication.of(QueuedPublication(publication, one.motion)))
    if row != len(rows.alias):
        raise InvalidArgument("has the chunks of other publications", "log.publications")
    return SessionLog(
        part.epoch, part.position, part.motion, part.last_at, part.stopping, tuple(held)
    )
