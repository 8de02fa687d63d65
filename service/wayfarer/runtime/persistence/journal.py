"""Nothing lost: sessions, agents, goals and motion, kept on disk while the service runs.

The motion thread hands over what has changed: plain values and copied rows, which take
microseconds. A separate thread turns them into bytes and writes them, all that have gathered in
one transaction. Only the newest of each entry waits, so a disk that is slow or full costs no
memory; while nothing can be written, the service continues and `failing` is true.
"""

import asyncio
import re
import sqlite3
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import structlog

from wayfarer.config.limits import Limits
from wayfarer.errors import ArtifactError
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.persistence.journal_entries import (
    Member,
    Value,
    check_origin,
    decode,
    encode,
    no_agents,
)
from wayfarer.runtime.persistence.journal_file import Entries, EntryKind, JournalFile, Key
from wayfarer.runtime.persistence.scene_entries import (
    decode_scenes,
    obstacles_part,
    scene_part,
)
from wayfarer.runtime.persistence.snapshot import BodyStamp, SessionPart
from wayfarer.world.agents.records import SessionRecord
from wayfarer.world.scenes.scene_registry import SceneEntry, SceneRecord

log = structlog.get_logger(__name__)

ASIDE: Final = "set-aside"
"""Folder beside the journal, with a folder for each session that was set aside."""

RETRY_SECONDS: Final = 1.0
"""Pause between attempts to write to a disk that fails."""


class Journal:
    """Keeps what it is given. `put` takes microseconds."""

    def __init__(self, folder: Path, body: BodyStamp, meter: MetricsSink | None = None) -> None:
        """Opens the journal of a folder. Raises ArtifactError: see `JournalFile`; or when it was
        kept for another body.
        """
        self._meter = meter or MetricsSink()
        self._file = JournalFile(folder)
        self._entries = self._file.entries
        try:
            check_origin(self._entries, body, self._file.path)
        except ArtifactError:
            self._file.close()
            raise
        self._stored = set(self._entries.found)
        self._members: dict[Key, Member] = {}  # as they stand in the file
        self._left: dict[str, list[str]] = {}  # agents in the file that are not here, by session
        self._pending: dict[Key, Value] = {(EntryKind.BODY, ""): body}
        self._aside: list[_Aside] = []  # sessions to be set aside
        self._noted = self._written = 0  # puts, and how many of them have been written
        self._waiting: list[tuple[int, Future[None]]] = []  # puts that must be written
        self._changed = threading.Condition()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self.failing = False
        """Whether nothing can be written at present; changes are kept in memory until then."""

    # Life

    @property
    def folder(self) -> Path:
        """Where the file is."""
        return self._file.path.parent

    def restore(self, limits: Limits) -> list[SessionRecord]:
        """The sessions that the file held at the start, oldest first; damaged ones are set aside,
        with their agents, once the writer has been started.
        """
        records, lost = decode(self._entries, limits)
        for name, agents in lost.items():
            self._meter.set_aside("unsound")
            self.set_aside(name, agents)
        return records

    def restore_scenes(self) -> list[SceneRecord]:
        """The scenes that the file held, oldest first."""
        return decode_scenes(self._entries)

    def start(self) -> None:
        """Starts the writer, once."""
        self._entries = Entries()  # they have been restored
        self._thread.start()

    def stop(self) -> None:
        """Writes what waits and closes the file."""
        with self._changed:
            self._stopping = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join()
        self._file.close()

    async def durable(self) -> None:
        """Returns when everything put before is on disk, or cannot be written now."""
        with self._changed:
            if self.failing or self._stopping or self._written >= self._noted:
                return
            written = Future[None]()
            written.set_running_or_notify_cancel()  # it cannot be cancelled: the writer ends it
            self._waiting.append((self._noted, written))
        await asyncio.wrap_future(written)

    # Callable from any thread

    def put_scene(self, kept: SceneEntry) -> None:
        """A scene is new."""
        self.put({(EntryKind.SCENE, kept.scene_id): scene_part(kept)})

    def put_obstacles(self, kept: SceneEntry) -> None:
        """Something has come, gone or been moved in a scene."""
        self.put({(EntryKind.OBSTACLES, kept.scene_id): obstacles_part(kept)})

    def drop_scene(self, scene_id: str) -> None:
        """A scene is gone."""
        self.put({(kind, scene_id): None for kind in (EntryKind.SCENE, EntryKind.OBSTACLES)})

    # Called on the motion thread

    def leave(self, record: SessionRecord) -> None:
        """A session of the file cannot be resumed; it stays there until its id is used again."""
        self._left[record.session_id] = [agent.agent_id for agent in record.agents]

    def open_session(self, session: SessionPart) -> None:
        """A session is new; agents that another one of its id has left in the file go."""
        gone = no_agents(self._left.pop(session.session_id, ()))
        self.put({**gone, (EntryKind.SESSION, session.session_id): session})

    def set_aside(self, session_id: str, agent_ids: Iterable[str], scene_id: str = "") -> None:
        """Moves the entries of a session into a separate journal, in a folder of `ASIDE` with which
        a server can be started; its scene is copied.
        """
        keys = (EntryKind.SESSION, session_id), *no_agents(agent_ids)
        copied = [(EntryKind.BODY, "")]
        if scene_id:
            copied += [(EntryKind.SCENE, scene_id), (EntryKind.OBSTACLES, scene_id)]
        with self._changed:
            self._aside.append(_Aside(session_id, keys, copied))
            self._changed.notify()

    def put(self, values: Mapping[Key, Value]) -> None:
        """Entries have changed."""
        with self._changed:
            self._pending.update(values)
            self._noted += 1
            self._changed.notify()

    # The writer

    def _run(self) -> None:
        while not self._stopping or self._pending or self._aside:
            with self._changed:
                self._changed.wait_for(lambda: self._pending or self._aside or self._stopping)
                taken, self._pending, noted = self._pending, {}, self._noted
                aside, self._aside = self._aside, []
            for one in aside:
                self._move(one)
            self._try_write(taken)
            with self._changed:
                self._written = noted
                self._release()
                if self.failing:
                    if self._stopping:
                        return
                    self._changed.wait_for(lambda: self._stopping, RETRY_SECONDS)

    def _move(self, one: "_Aside") -> None:
        moment = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
        name = re.sub(r"[^\w-]", "_", one.session_id)[:64]
        folder = self._file.path.parent / ASIDE / f"{name}-{moment}"
        try:
            self._file.move(one.keys, one.copied, folder)
        except (sqlite3.Error, ArtifactError, OSError) as error:
            log.error(
                "a session could not be set aside; it stays in the journal",
                session=one.session_id,
                error=repr(error),
            )
            return
        for key in one.keys:
            self._stored.discard(key)
            self._members.pop(key, None)
        log.error("a session was set aside", session=one.session_id, folder=str(folder))

    def _try_write(self, taken: dict[Key, Value]) -> None:
        try:
            self._meter.journal(self._write(taken), failed=False)
        except Exception as error:  # whatever it is, the waiters must be told
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

    def _write(self, taken: Mapping[Key, Value]) -> int:
        """How many entries that took."""
        changed = {key: value for key, value in taken.items() if self._differs(key, value)}
        self._file.write(encode(changed))
        for key, value in changed.items():
            if value is None:
                self._stored.discard(key)
                self._members.pop(key, None)
            else:
                self._stored.add(key)
                if isinstance(value, Member):
                    self._members[key] = value
        return len(changed)

    def _differs(self, key: Key, value: Value) -> bool:
        """Goals change seldom, places always."""
        return not isinstance(value, Member) or self._members.get(key) != value

    def _release(self) -> None:
        waiting, self._waiting = self._waiting, []
        for noted, written in waiting:
            if self.failing or noted <= self._written:
                written.set_result(None)
            else:
                self._waiting.append((noted, written))


@dataclass(frozen=True, slots=True)
class _Aside:
    """A session to be set aside: entries to move, and entries to copy."""

    session_id: str
    keys: Sequence[Key]
    copied: Sequence[Key]
