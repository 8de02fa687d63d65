"""The journal on disk: one SQLite file of small entries, opened by one server at a time.

An entry is some bytes under a kind and an id, with a checksum: SQLite itself would not notice a
flipped bit. Writes are transactions in write-ahead-log mode, so that a process that is killed
loses nothing that has been committed (`synchronous = NORMAL`: power loss may cost the last
transactions, never the file).
"""

import sqlite3
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Final

import structlog
from filelock import FileLock, Timeout

from wayfarer.errors import ArtifactError

log = structlog.get_logger(__name__)

NAME: Final = "journal.sqlite3"
LOCK: Final = "journal.lock"
VERSION: Final = 1
APPLICATION: Final = 0x57415946  # "WAYF"; tells our files from other SQLite files

DAMAGE: Final = frozenset({sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR})
"""Primary result codes of a broken file (SQLITE_ERROR: our table is missing). Other codes concern
the disk or permissions, not the file."""


class EntryKind(IntEnum):
    """The subject of an entry; numbers are kept in files."""

    BODY = 0
    SESSION = 1
    AGENT = 2
    MOTION = 3
    SCENE = 4
    OBSTACLES = 5


Key = tuple[EntryKind, str]
Changes = Mapping[Key, bytes | None]
"""New contents of entries; None: gone."""


@dataclass(slots=True)
class Entries:
    """The contents of a file."""

    found: dict[Key, bytes] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)  # what could not be read, in words

    def of(self, kind: EntryKind) -> dict[str, bytes]:
        """Entries of a kind by id."""
        return {key[1]: body for key, body in self.found.items() if key[0] is kind}


class JournalFile:
    """The open file. Used by one thread at a time."""

    def __init__(self, folder: Path) -> None:
        """Opens or begins the journal in `folder`, which is made if it is missing.

        `entries` is what it held. A damaged file is moved aside, and what could be read of it
        written to a new one. Raises ArtifactError when another server has the folder, when the
        file was made by a later version, or when the folder cannot be used at all.
        """
        self.path = folder / NAME
        self._lock = _lock(folder)
        try:
            self.entries = self._open()
        except BaseException:
            self._lock.release()
            raise

    def write(self, changes: Changes) -> None:
        """All of them or none. Raises sqlite3.Error."""
        gone = [key for key, body in changes.items() if body is None]
        kept = [(*key, body, zlib.crc32(body)) for key, body in changes.items() if body is not None]
        with self._connection:
            self._connection.execute("BEGIN IMMEDIATE")
            self._connection.executemany("DELETE FROM entries WHERE kind = ? AND id = ?", gone)
            self._connection.executemany(
                "INSERT INTO entries (kind, id, body, crc) VALUES (?, ?, ?, ?) "
                "ON CONFLICT (kind, id) DO UPDATE SET body = excluded.body, crc = excluded.crc",
                kept,
            )

    def move(self, keys: Iterable[Key], copied: Iterable[Key], folder: Path) -> None:
        """Moves entries into a separate journal in `folder`, with copies of others.

        Raises sqlite3.Error, ArtifactError.
        """
        moved = list(keys)
        found = {key: body for key in (*moved, *copied) if (body := self._body(key)) is not None}
        other = JournalFile(folder)
        try:
            other.write(found)
        finally:
            other.close()
        self.write(dict.fromkeys(moved))

    def _body(self, key: Key) -> bytes | None:
        row = self._connection.execute(
            "SELECT body FROM entries WHERE kind = ? AND id = ?", key
        ).fetchone()
        return None if row is None else bytes(row[0])

    def close(self) -> None:
        """Gives the folder back."""
        with suppress(sqlite3.Error):  # what could not be written has been logged already
            self._connection.close()
        self._lock.release()

    def _open(self) -> Entries:
        entries = Entries()
        try:
            if self.path.exists():
                entries = _read(self.path)
                if entries.damage:
                    self._set_aside(entries)
            self.path.touch(mode=0o600)  # names of callers are in it
            self._connection = _connect(self.path)
            if entries.damage or not entries.found:
                _prepare(self._connection)
            if entries.found and entries.damage:
                self.write(entries.found)
        except (sqlite3.Error, OSError) as error:
            raise ArtifactError(f"{self.path}: the journal cannot be opened: {error}") from error
        return entries

    def _set_aside(self, entries: Entries) -> None:
        moment = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
        aside = self.path.with_name(f"{NAME}.damaged-{moment}")
        for suffix in ("", "-wal"):
            part = self.path.with_name(NAME + suffix)
            if part.exists():
                part.replace(aside.with_name(aside.name + suffix))
        log.error(
            "the journal is damaged: what can be read of it is kept, the file is set aside",
            damage=entries.damage[:8],
            sessions_kept=len(entries.of(EntryKind.SESSION)),
            agents_kept=len(entries.of(EntryKind.AGENT)),
            set_aside=str(aside),
        )


def _lock(folder: Path) -> FileLock:
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        lock = FileLock(folder / LOCK, timeout=0, thread_local=False)
        lock.acquire()
    except Timeout:
        raise ArtifactError(
            f"{folder}: another server keeps its state here; give each its own state_dir"
        ) from None
    except OSError as error:
        raise ArtifactError(f"{folder}: state cannot be kept here: {error.strerror}") from error
    return lock


def _connect(path: Path, damaged: bool = False) -> sqlite3.Connection:
    # Transactions are ours alone (isolation_level None); the writer is not the thread that opens.
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    try:
        connection.execute("PRAGMA locking_mode = EXCLUSIVE")  # no shared memory: no other reads
        if damaged:  # else SQLite does not read a file at all that has been cut short
            connection.execute("PRAGMA writable_schema = ON")
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = NORMAL")
    except BaseException:
        connection.close()  # it may hold a lock
        raise
    return connection


def _prepare(connection: sqlite3.Connection) -> None:
    connection.execute(
        "CREATE TABLE IF NOT EXISTS entries ("
        "number INTEGER PRIMARY KEY, kind INTEGER NOT NULL, id TEXT NOT NULL, "
        "body BLOB NOT NULL, crc INTEGER NOT NULL, UNIQUE (kind, id))"
    )
    connection.execute(f"PRAGMA application_id = {APPLICATION}")
    connection.execute(f"PRAGMA user_version = {VERSION}")


def _read(path: Path) -> Entries:
    """All sound entries of a file. Raises ArtifactError for a file that is not a journal."""
    entries = Entries()
    try:
        with closing(_connect(path)) as connection:
            _check_maker(path, connection)
            for (problem,) in connection.execute("PRAGMA quick_check(8)"):
                if problem != "ok":
                    _add(entries, problem)
    except sqlite3.DatabaseError as error:
        _note(entries, error)
    for direction in ("ASC", "DESC"):
        # From both ends, each as far as it gets: entries behind a damaged page are found, too.
        if _scan(path, direction, entries):
            break
    return entries


def _check_maker(path: Path, connection: sqlite3.Connection) -> None:
    [application] = connection.execute("PRAGMA application_id").fetchone()
    [version] = connection.execute("PRAGMA user_version").fetchone()
    [tables] = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    if application != APPLICATION and tables:
        raise ArtifactError(f"{path}: is a SQLite file, but no journal of Wayfarer's")
    if version > VERSION:
        raise ArtifactError(
            f"{path}: was made by a later version of Wayfarer (format {version}; this one reads "
            f"{VERSION}); use that version, or another state_dir"
        )


def _scan(path: Path, direction: str, entries: Entries) -> bool:
    """Reads entries in one direction; whether the end was reached."""
    try:
        with closing(_connect(path, damaged=bool(entries.damage))) as connection:
            for kind, name, body, crc in _rows(connection, direction):
                _enter(entries, kind, name, body, crc)
    except sqlite3.DatabaseError as error:
        _note(entries, error)
        return False
    return True


def _rows(connection: sqlite3.Connection, direction: str) -> Iterator[tuple[object, ...]]:
    if not connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
        return
    # Through the table, not through its index, which may be damaged on its own.
    yield from connection.execute(
        f"SELECT kind, id, body, crc FROM entries NOT INDEXED ORDER BY number {direction}"
    )


def _enter(entries: Entries, kind: object, name: object, body: object, crc: object) -> None:
    match kind, name, body:
        case int(), str(), bytes() if kind in set(EntryKind) and zlib.crc32(body) == crc:
            entries.found[EntryKind(kind), name] = body
        case _:
            _add(entries, f"entry {kind} {name!r} is damaged")


def _note(entries: Entries, error: sqlite3.DatabaseError) -> None:
    """Counts an error as damage. Raises it when it is no such thing."""
    if getattr(error, "sqlite_errorcode", 0) & 0xFF not in DAMAGE:
        raise error
    _add(entries, str(error))


def _add(entries: Entries, damage: str) -> None:
    if damage not in entries.damage:
        entries.damage.append(damage)
