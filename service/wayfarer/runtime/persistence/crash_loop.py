"""Finds the session that ends the process, when a server ends again and again as it starts.

A file in the state folder counts the starts, and is removed once the server has run for a while or
stops in good order. After `STARTS` starts that ended early, sessions are tried one after the other
before they resume; a session during whose trials the process has ended twice is set aside.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import structlog

from wayfarer.errors import WayfarerError

log = structlog.get_logger(__name__)

NAME: Final = "starts.json"
STARTS: Final = 2
"""Starts that ended early after which sessions are tried."""

TRIES: Final = 2
"""Trials of a session during which the process has ended, after which it is set aside."""

CALM_SECONDS: Final = 30.0
"""Seconds after the start from which the process does not end because of what it has restored."""


class CrashLoopGuard:
    """The count of a state folder; without one, nothing is counted."""

    def __init__(self, folder: Path | None) -> None:
        self._file = None if folder is None else folder / NAME
        self._starts = 0
        self._ended: dict[str, int] = {}  # trials during which the process has ended, by session

    def begin(self) -> bool:
        """Counts a start; returns whether sessions must be tried one after the other."""
        if self._file is None:
            return False
        self._read()
        self._starts += 1
        self._write()
        is_needed = self._starts > STARTS
        if is_needed:
            log.warning(
                "the server ended soon after each of its last starts: its sessions are tried one "
                "after the other",
                starts=self._starts - 1,
            )
        return is_needed

    def passes(self, name: str, run: Callable[[], object]) -> bool:
        """Whether a session or scene can resume. `run` steps the session in a separate world, or
        restores the scene.
        """
        if self._ended.get(name, 0) >= TRIES:
            log.error("the process has ended twice while this was tried; it is left out", name=name)
            return False
        self._ended[name] = self._ended.get(name, 0) + 1
        self._write()
        try:
            run()
        except WayfarerError:
            return True  # it does not fit in here, which is no fault of it
        except Exception as error:
            log.error("a session fails when it is tried", name=name, exc_info=error)
            return False
        finally:
            self._ended.pop(name)
            self._write()
        return True

    def end(self) -> None:
        """The server runs well, or stops in good order."""
        if self._file is not None:
            self._file.unlink(missing_ok=True)

    def _read(self) -> None:
        assert self._file is not None
        try:
            kept: Any = json.loads(self._file.read_text())
            self._starts = int(kept["starts"])
            self._ended = {str(name): int(count) for name, count in kept["ended"].items()}
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            log.warning("the count of starts cannot be read", file=str(self._file), why=str(error))

    def _write(self) -> None:
        assert self._file is not None
        try:
            self._file.write_text(json.dumps({"starts": self._starts, "ended": self._ended}))
        except OSError as error:
            log.warning("the starts cannot be counted", file=str(self._file), why=error.strerror)
