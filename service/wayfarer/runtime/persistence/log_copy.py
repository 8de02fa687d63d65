"""A command log that is copied while it grows: each part holds what is new since the one before.

The parts together are the log as of the last of them. Between servers only; checked all the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pydantic import BaseModel, ConfigDict

from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument
from wayfarer.runtime.persistence.container import ContainerKind, seal, unseal
from wayfarer.runtime.persistence.log_format import (
    LogHeader,
    LogOrigin,
    TrackPart,
    log_header,
    most_log_bytes,
    poses,
    read_log,
    track_part,
)
from wayfarer.runtime.persistence.record import (
    UNCOPIED,
    AgentTrack,
    CommandLog,
    LogMark,
    LogNews,
)
from wayfarer.runtime.persistence.snapshot import pack_agents, parse


@dataclass(frozen=True, slots=True)
class Replica:
    """A session or scene for when its server dies, and what is new of a recorded session's log."""

    state: bytes
    log_part: bytes = b""  # empty: nothing is new, or it is not recorded
    mark: LogMark = UNCOPIED  # how far its log has come


class _Part(BaseModel):
    """The JSON of a part."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    log: LogHeader | None = None  # of the first part: its tracks are below
    overflowed: bool = False  # the log has been dropped
    tracks: tuple[TrackPart, ...] = ()  # without a start: they continue earlier ones


def encode_part(news: LogNews, origin: LogOrigin) -> bytes:
    """The next part of a log; empty when there is nothing new."""
    log, new = news.log, news.new_tracks
    if not (log.tracks or news.overflows or news.begins):
        return b""
    part = _Part(
        log=log_header(log, origin, ()) if news.begins else None,
        overflowed=news.overflows,
        tracks=tuple(_part(track, name in new) for name, track in log.tracks.items()),
    )
    arrays = pack_agents(poses(track for name, track in log.tracks.items() if name in new))
    text = part.model_dump_json(exclude_none=True)
    return seal(ContainerKind.LOG_PART, text.encode(), arrays)


def join_parts(
    parts: Sequence[bytes], origin: LogOrigin, limits: Limits, most_entries: int
) -> CommandLog | None:
    """The log; None: it has been dropped. Raises InvalidArgument, FailedPrecondition."""
    room, values = 2 * most_log_bytes(most_entries), 32 * most_entries
    header: LogHeader | None = None
    found, arrays = dict[str, list[TrackPart]](), list[bytes]()
    for data in parts:
        content = unseal(ContainerKind.LOG_PART, data, room)
        room -= len(content.header) + len(content.arrays)
        part = parse(_Part, content.header, ContainerKind.LOG_PART, values)
        if part.overflowed:
            return None
        header = part.log or header
        for track in part.tracks:
            found.setdefault(track.agent_id, []).append(track)
        arrays.append(content.arrays)
    if header is None:
        raise InvalidArgument("the first part of the log is missing", "log")
    whole = header.model_copy(update={"tracks": tuple(map(_joined, found.values()))})
    return read_log(whole, b"".join(arrays), origin, limits, most_entries)


def _part(track: AgentTrack, is_new: bool) -> TrackPart:
    part = track_part(track, track.end - 1)
    return part if is_new else replace(part, spec=None, record=None, restarts=())


def _joined(parts: Sequence[TrackPart]) -> TrackPart:
    return replace(
        parts[0],
        entries=tuple(entry for part in parts for entry in part.entries),
        runs=tuple(run for part in parts for run in part.runs),
        schedules=tuple(schedule for part in parts for schedule in part.schedules),
        end=parts[-1].end,
    )
