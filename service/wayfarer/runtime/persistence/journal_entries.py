"""The journal's entries of a session and its agents: values as bytes, and back."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
import structlog
from numpy.typing import NDArray
from pydantic import TypeAdapter

from wayfarer.config.limits import Limits
from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer.runtime.persistence.journal_file import Entries, EntryKind, Key
from wayfarer.runtime.persistence.packing import pack, unpack
from wayfarer.runtime.persistence.scene_entries import OBSTACLES, SCENE, ObstaclesPart, ScenePart
from wayfarer.runtime.persistence.snapshot import (
    AgentPart,
    AgentRows,
    BodyStamp,
    SessionPart,
    check_body,
    join_agent,
    join_session,
)
from wayfarer.world.agents.records import AgentRecord, SessionRecord
from wayfarer.world.record_checks import check_agent_record

log = structlog.get_logger(__name__)

_BODY: Final = TypeAdapter(BodyStamp)
_SESSION: Final = TypeAdapter(SessionPart)


@dataclass(frozen=True, slots=True)
class Member:
    """An agent and where it belongs."""

    session_id: str
    part: AgentPart


_MEMBER: Final = TypeAdapter(Member)
_JSON: Final[dict[type, TypeAdapter[Any]]] = {
    BodyStamp: _BODY,
    SessionPart: _SESSION,
    Member: _MEMBER,
    ScenePart: SCENE,
    ObstaclesPart: OBSTACLES,
}


@dataclass(frozen=True)
class CapturedAgents:
    """Agents at rest, together: rows in the order of `members`."""

    members: Sequence[Member]
    rows: AgentRows

    @cached_property
    def packed(self) -> NDArray[np.uint8]:
        """Bytes [N, B] of the rows."""
        return pack(self.rows)


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a crowd, to be packed by the writer."""

    crowd: CapturedAgents
    number: int


Value = BodyStamp | SessionPart | Member | Row | ScenePart | ObstaclesPart | None
"""The new contents of an entry; None: it is gone."""


def agents_in(crowd: CapturedAgents) -> dict[Key, Value]:
    """The entries of agents that are new, got a command, or have moved."""
    values: dict[Key, Value] = {}
    for number, member in enumerate(crowd.members):
        name = member.part.agent_id
        values[EntryKind.AGENT, name] = member
        values[EntryKind.MOTION, name] = Row(crowd, number)
    return values


def no_agents(agent_ids: Iterable[str]) -> dict[Key, Value]:
    """The entries of agents that are gone."""
    kinds = (EntryKind.AGENT, EntryKind.MOTION)
    return {(kind, name): None for name in agent_ids for kind in kinds}


def encode(values: Mapping[Key, Value]) -> dict[Key, bytes | None]:
    """The entries as bytes. An entry that cannot be encoded is logged and left out."""
    found: dict[Key, bytes | None] = {}
    for key, value in values.items():
        try:
            found[key] = _bytes(value)
        except Exception as error:
            log.error("an entry cannot be written to the journal", key=key, error=repr(error))
    return found


def _bytes(value: Value) -> bytes | None:
    match value:
        case None:
            return None
        case Row(crowd, number):
            return crowd.packed[number].tobytes()
        case _:
            return _JSON[type(value)].dump_json(value)


# Entries of a file


def check_origin(entries: Entries, body: BodyStamp, path: Path) -> None:
    """Raises ArtifactError when the journal was kept for another body."""
    for text in entries.of(EntryKind.BODY).values():
        kept = _BODY.validate_json(text)
        if kept != body:
            raise ArtifactError(
                f"{path}: holds motion of {kept}; this server has {body}: use that body again, or "
                "another state_dir"
            )


def decode(entries: Entries, limits: Limits) -> tuple[list[SessionRecord], dict[str, list[str]]]:
    """All sound sessions, oldest first; damaged ones are logged and left out. And by session the
    ids of the agents that have lost it.
    """
    agents = _agents(entries, limits)
    records, left = list[SessionRecord](), dict[str, list[str]]()
    for name, text in entries.of(EntryKind.SESSION).items():
        own = tuple(sorted(agents.pop(name, ()), key=lambda agent: agent.alias))
        try:
            records.append(join_session(_SESSION.validate_json(text), own, limits))
        except Exception as error:
            _lost("session", name, error)
            left[name] = [agent.agent_id for agent in own]
    for name, others in agents.items():
        left[name] = [agent.agent_id for agent in others]
        for agent in others:
            _lost("agent", agent.agent_id, f"its session {name!r} is not there")
    return sorted(records, key=lambda record: record.created_at), left


def _agents(entries: Entries, limits: Limits) -> dict[str, list[AgentRecord]]:
    """The sound ones, by session."""
    found: dict[str, list[AgentRecord]] = {}
    motion = entries.of(EntryKind.MOTION)
    for name, text in entries.of(EntryKind.AGENT).items():
        try:
            member = _MEMBER.validate_json(text)
            row = unpack(AgentRows, motion.get(name, b""), "motion")
            if len(row.seq) != 1:
                raise InvalidArgument("its motion could not be read", "motion")
            record = join_agent(member.part, row)
            check_agent_record(record, limits, name)
            check_body(record, name)
        except Exception as error:
            _lost("agent", name, error)
        else:
            found.setdefault(member.session_id, []).append(record)
    return found


def _lost(what: str, name: str, why: object) -> None:
    log.error(f"the journal's {what} is lost: its entry is unsound", name=name, why=str(why))
