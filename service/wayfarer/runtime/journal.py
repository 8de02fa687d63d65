"""Nothing lost: sessions, agents, goals and motion, kept on disk while the service runs.

The motion thread hands over what has changed: plain values and copied rows, which take
microseconds. A thread of its own turns them into bytes and writes them, whatever has gathered in
one transaction. Only the newest of each entry waits, so a disk that is slow or full costs no
memory; while it takes nothing, the service goes on and `failing` says so.
"""

import asyncio
import sqlite3
import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np
import structlog
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer.runtime.handover import AgentRecord, SessionRecord, check_agent_record
from wayfarer.runtime.inbox import post
from wayfarer.runtime.journal_file import Entries, JournalFile, Key, Kind
from wayfarer.runtime.meter import Meter, NoMeter
from wayfarer.runtime.packing import pack, unpack
from wayfarer.runtime.settings import Limits
from wayfarer.runtime.snapshot import (
    AgentPart,
    BodyStamp,
    SessionPart,
    Standing,
    check_body,
    join_agent,
    join_session,
)

log = structlog.get_logger(__name__)

RETRY_SECONDS: Final = 1.0
"""Between attempts to write to a disk that takes nothing."""

_BODY: Final = TypeAdapter(BodyStamp)
_SESSION: Final = TypeAdapter(SessionPart)


@dataclass(frozen=True, slots=True)
class Member:
    """An agent and where it belongs."""

    session_id: str
    part: AgentPart


_MEMBER: Final = TypeAdapter(Member)


@dataclass(frozen=True)
class Crowd:
    """Agents at rest, together: rows in the order of `members`."""

    members: Sequence[Member]
    rows: Standing

    @cached_property
    def packed(self) -> NDArray[np.uint8]:
        """Bytes [N, B] of the rows."""
        return pack(self.rows)


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a crowd, to be packed by the writer."""

    crowd: Crowd
    number: int


Value = SessionPart | Member | Row | None
"""What an entry shall hold; None: it is gone."""


class Journal:
    """Keeps what it is given. `put_…`, `drop_…` and `refresh` take microseconds."""

    def __init__(self, folder: Path, body: BodyStamp, meter: Meter | None = None) -> None:
        """Open the journal of a folder. Raises ArtifactError: see `JournalFile`; or when it was
        kept for another body.
        """
        self._meter = meter or NoMeter()
        self._file = JournalFile(folder)
        self._entries = self._file.entries
        try:
            _check_body(self._entries, body, self._file.path)
        except ArtifactError:
            self._file.close()
            raise
        self._stored = set(self._entries.found)
        self._members: dict[Key, Member] = {}  # as they stand in the file
        self._pending: dict[Key, Value | BodyStamp] = {(Kind.BODY, ""): body}
        self._noted = self._written = 0  # puts, and how many of them have been written
        self._waiting: list[_Waiter] = []
        self._changed = threading.Condition()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self.failing = False
        """Nothing can be written at present; what has changed since is kept in memory."""

    # Life

    def restore(self, limits: Limits) -> list[SessionRecord]:
        """What the file held when it was opened, oldest first; what is unsound is told and lost."""
        return _sessions(self._entries, limits)

    def start(self) -> None:
        """Start the writer, once."""
        self._entries = Entries()  # they have been restored
        self._thread.start()

    def stop(self) -> None:
        """Write what waits and close the file."""
        with self._changed:
            self._stopping = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join()
        self._file.close()

    async def durable(self) -> None:
        """Return when all that has been put before is on disk, or cannot be written now."""
        loop = asyncio.get_running_loop()
        with self._changed:
            if self.failing or self._stopping or self._written >= self._noted:
                return
            waiter = _Waiter(self._noted, loop, loop.create_future())
            self._waiting.append(waiter)
        await waiter.future

    # From the motion thread

    def put_session(self, session: SessionPart) -> None:
        """A session is new or has changed; its agents are put on their own."""
        self._put({(Kind.SESSION, session.session_id): session})

    def refresh(self, crowd: Crowd) -> None:
        """Agents are new, have been told something, or stand elsewhere now."""
        values: dict[Key, Value | BodyStamp] = {}
        for number, member in enumerate(crowd.members):
            name = member.part.agent_id
            values[Kind.AGENT, name] = member
            values[Kind.MOTION, name] = Row(crowd, number)
        self._put(values)

    def drop_agents(self, agent_ids: Iterable[str]) -> None:
        """Agents are gone."""
        kinds = (Kind.AGENT, Kind.MOTION)
        self._put({(kind, name): None for name in agent_ids for kind in kinds})

    def drop_session(self, session_id: str, agent_ids: Iterable[str]) -> None:
        """A session and its agents are gone."""
        self.drop_agents(agent_ids)
        self._put({(Kind.SESSION, session_id): None})

    def _put(self, values: Mapping[Key, Value | BodyStamp]) -> None:
        with self._changed:
            self._pending.update(values)
            self._noted += 1
            self._changed.notify()

    # The writer

    def _run(self) -> None:
        while not self._stopping or self._pending:
            with self._changed:
                self._changed.wait_for(lambda: self._pending or self._stopping)
                taken, self._pending, noted = self._pending, {}, self._noted
            self._try_write(taken)
            with self._changed:
                self._written = noted
                self._release()
                if self.failing:
                    if self._stopping:
                        return
                    self._changed.wait_for(lambda: self._stopping, RETRY_SECONDS)

    def _try_write(self, taken: dict[Key, Value | BodyStamp]) -> None:
        try:
            self._meter.journal(self._write(taken), failed=False)
        except Exception as error:  # whatever it is, those who wait must not wait for ever
            self._meter.journal(0, failed=True)
            if not self.failing:
                log.error(
                    "the journal cannot be written; the service goes on, and what changes now "
                    "would be lost with it",
                    error=repr(error),
                    file=str(self._file.path),
                    exc_info=not isinstance(error, sqlite3.Error),
                )
            self.failing = True
            with self._changed:
                waiting = taken | self._pending
                # What never came to the file need not be taken out of it.
                self._pending = {
                    key: value
                    for key, value in waiting.items()
                    if value is not None or key in self._stored
                }
        else:
            if self.failing:
                log.info("the journal is written again; nothing was lost")
            self.failing = False

    def _write(self, taken: Mapping[Key, Value | BodyStamp]) -> int:
        """How many entries that took."""
        changed = {key: value for key, value in taken.items() if self._differs(key, value)}
        self._file.write({key: _encode(value) for key, value in changed.items()})
        for key, value in changed.items():
            if value is None:
                self._stored.discard(key)
                self._members.pop(key, None)
            else:
                self._stored.add(key)
                if isinstance(value, Member):
                    self._members[key] = value
        return len(changed)

    def _differs(self, key: Key, value: Value | BodyStamp) -> bool:
        """Goals change seldom, places always."""
        return not isinstance(value, Member) or self._members.get(key) != value

    def _release(self) -> None:
        ready = [w for w in self._waiting if self.failing or w.noted <= self._written]
        self._waiting = [w for w in self._waiting if w not in ready]
        for waiter in ready:
            post(waiter.loop, waiter.settle)


@dataclass(frozen=True, slots=True, eq=False)
class _Waiter:
    """Somebody who waits until so many puts have been written."""

    noted: int
    loop: asyncio.AbstractEventLoop
    future: asyncio.Future[None]

    def settle(self) -> None:
        if not self.future.done():  # the caller may have been cancelled meanwhile
            self.future.set_result(None)


def _encode(value: Value | BodyStamp) -> bytes | None:
    match value:
        case None:
            return None
        case Row(crowd, number):
            return crowd.packed[number].tobytes()
        case SessionPart():
            return _SESSION.dump_json(value)
        case Member():
            return _MEMBER.dump_json(value)
        case BodyStamp():
            return _BODY.dump_json(value)


# What a file held


def _check_body(entries: Entries, body: BodyStamp, path: Path) -> None:
    """Raises ArtifactError when the journal was kept for another body."""
    for text in entries.of(Kind.BODY).values():
        kept = _BODY.validate_json(text)
        if kept != body:
            raise ArtifactError(
                f"{path}: holds motion of {kept}; this server has {body}: use that body again, or "
                "another state_dir"
            )


def _sessions(entries: Entries, limits: Limits) -> list[SessionRecord]:
    agents = _agents(entries, limits)
    records: list[SessionRecord] = []
    for name, text in entries.of(Kind.SESSION).items():
        own = tuple(sorted(agents.pop(name, ()), key=lambda agent: agent.alias))
        try:
            records.append(join_session(_SESSION.validate_json(text), own, limits))
        except (ValidationError, InvalidArgument) as error:
            _lost("session", name, error)
    for name, left in agents.items():
        for agent in left:
            _lost("agent", agent.agent_id, f"its session {name!r} is not there")
    return sorted(records, key=lambda record: record.created_at)


def _agents(entries: Entries, limits: Limits) -> dict[str, list[AgentRecord]]:
    """Those that are sound, by session."""
    found: dict[str, list[AgentRecord]] = {}
    motion = entries.of(Kind.MOTION)
    for name, text in entries.of(Kind.AGENT).items():
        try:
            member = _MEMBER.validate_json(text)
            row = unpack(Standing, motion.get(name, b""), "motion")
            if len(row.seq) != 1:
                raise InvalidArgument("its motion could not be read", "motion")
            record = join_agent(member.part, row)
            check_agent_record(record, limits, name)
            check_body(record, name)
        except (ValidationError, InvalidArgument) as error:
            _lost("agent", name, error)
        else:
            found.setdefault(member.session_id, []).append(record)
    return found


def _lost(what: str, name: str, why: object) -> None:
    log.error(f"the journal's {what} is lost: its entry is unsound", name=name, why=str(why))
