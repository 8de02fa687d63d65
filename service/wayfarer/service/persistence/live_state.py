"""A live session as bytes, from which another server continues as if nothing had happened.

A container (container.py) in which a snapshot lies as any other, with what a snapshot has not: when
the next chunks are due, the last seconds of publications for streams that resume, the crowd, the
log of a recorded session. Between servers only; checked all the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Annotated, ClassVar, Final, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from wayfarer.errors import InvalidArgument
from wayfarer.limits import Limits
from wayfarer.service.persistence.container import ContainerKind, seal, unseal
from wayfarer.service.persistence.journal_entries import CapturedAgents
from wayfarer.service.persistence.packing import pack, row_bytes, unpack
from wayfarer.service.persistence.snapshot import (
    AGENT_BYTES,
    SESSION_BYTES,
    BodyStamp,
    SessionPart,
    decode_session,
    encode_session,
    most_bytes,
    parse,
)
from wayfarer.service.streams.publications import Publication
from wayfarer.service.streams.publisher import SessionLog
from wayfarer.service.streams.subscription import QueuedPublication
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS
from wayfarer.world.agents.agent import MotionChunks
from wayfarer.world.agents.records import LiveRows, SessionRecord
from wayfarer.world.events import Event
from wayfarer.world.rows import Double, Flags, Float, Int, Int8, Int16, Rows, Shape, UInt8
from wayfarer.world.scenes.populate import CrowdPeople

RING_BYTES: Final = 8 << 20
"""Bytes of publications that go along, the latest; a stream that resumes before them has a gap."""

MAX_COUNT: Final = 2**53
STORED: Final = 0  # zlib's level: what is large here has been compressed, or is poses


@dataclass(slots=True, eq=False)
class _ChunkRows(Rows):
    """`MotionChunks` but for the ids."""

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


class _LiveHeader(BaseModel):
    """The JSON of a live session."""

    model_config = ConfigDict(extra="forbid", frozen=True, ser_json_inf_nan="strings")

    # bytes of snapshot, log, agents' rows, chunks
    parts: Annotated[tuple[Count, ...], Field(min_length=4, max_length=4)]
    log: _LogPart
    crowd: CrowdPeople | None


@dataclass(frozen=True, slots=True)
class LiveSession:
    """A session on its way."""

    record: SessionRecord
    rows: LiveRows  # of its agents, in order
    log: SessionLog
    crowd: CrowdPeople | None = None
    recording: bytes = b""  # as `ExportLog` gives it; empty: it is not recorded


class LiveParts(NamedTuple):
    """The state of a frozen session in its world and streams, all of one moment."""

    captured: tuple[SessionPart, CapturedAgents]
    rows: LiveRows
    log: SessionLog
    crowd: CrowdPeople | None


def encode_live(live: LiveParts, body: BodyStamp, recording: bytes) -> bytes:
    """The container."""
    session, crowd = live.captured
    agents = [member.part for member in crowd.members]
    snapshot, log = encode_session(session, agents, crowd.rows, body), live.log
    kept, chunks = _latest(log.held)
    names = {a: n for c in chunks for a, n in zip(c.alias.tolist(), c.agent_id, strict=True)}
    packed = [pack(_rows_of(c)).tobytes() for c in chunks]
    parts = (snapshot, recording, pack(live.rows).tobytes(), b"".join(packed))
    header = _LiveHeader(
        parts=tuple(map(len, parts)),
        log=_LogPart(
            epoch=log.epoch,
            position=log.position,
            motion=log.motion,
            last_at=log.last_at,
            stopping=dict(log.stopping),
            names=names,
            publications=tuple(
                _PublicationPart(
                    one.publication.position,
                    one.motion,
                    len(one.publication.chunks),
                    one.publication.events,
                )
                for one in kept
            ),
        ),
        crowd=live.crowd,
    )
    return seal(ContainerKind.LIVE, header.model_dump_json().encode(), b"".join(parts), STORED)


def decode_live(data: bytes, body: BodyStamp, limits: Limits) -> LiveSession:
    """Raises InvalidArgument, FailedPrecondition."""
    content = unseal(ContainerKind.LIVE, data, most_live_bytes(limits))
    values = 10_000 + limits.agents_per_session * 64
    header = parse(_LiveHeader, content.header, ContainerKind.LIVE, values)
    if sum(header.parts) != len(content.arrays):
        raise InvalidArgument("live session is cut short", "live session")
    parts, start = list[bytes](), 0
    for size in header.parts:
        parts.append(content.arrays[start : start + size])
        start += size
    snapshot, recording, rows, chunks = parts
    record = decode_session(snapshot, body, limits)
    found = unpack(LiveRows, rows, "rows")
    if len(found.shown_at) != len(record.agents):
        raise InvalidArgument("has the rows of other agents", "rows")
    return LiveSession(
        record,
        found,
        _log(header.log, unpack(_ChunkRows, chunks, "chunks")),
        header.crowd,
        recording,
    )


def is_live(data: bytes) -> bool:
    """Whether that is what `encode_live` gives, and no snapshot."""
    return data.startswith(ContainerKind.LIVE.value)


def most_live_bytes(limits: Limits) -> int:
    """Upper bound of a live session that this server accepts."""
    log_bytes = SESSION_BYTES + limits.log_entries * (AGENT_BYTES // 64)
    return 2 * most_bytes(limits) + RING_BYTES + row_bytes(_ChunkRows) + log_bytes


def _latest(
    held: Sequence[QueuedPublication],
) -> tuple[list[QueuedPublication], list[MotionChunks]]:
    """Those that fit into `RING_BYTES`, and the chunks of those that have some."""
    room, kept = RING_BYTES // row_bytes(_ChunkRows), list[QueuedPublication]()
    for one in reversed(held):
        room -= len(one.publication.chunks)
        if room < 0:
            break
        kept.append(one)
    kept.reverse()
    return kept, [one.publication.chunks for one in kept if one.publication.chunks]


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
    held, row = list[QueuedPublication](), 0
    for one in part.publications:
        chunks = every.take(np.arange(row, row + one.chunks))
        row += one.chunks
        held.append(QueuedPublication(Publication(one.position, chunks, one.events), one.motion))
    if row != len(rows.alias):
        raise InvalidArgument("has the chunks of other publications", "log.publications")
    return SessionLog(
        part.epoch, part.position, part.motion, part.last_at, part.stopping, tuple(held)
    )
