"""Compiled networks as files: what a start would compile again, the next one reads in a third of
the time.

A file's name is a hash of all that its network depends on, so one of another version, model or
machine is never found; its content begins with a hash of the rest, so a damaged one is never run.
A folder that cannot be read or written costs the time that it would have saved, and nothing else.
"""

import hashlib
import os
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np
import structlog
from numpy.typing import NDArray

log = structlog.get_logger(__name__)

SUFFIX: Final = ".network"
MOST: Final = 32
"""Files that are kept, 24 MB each: those that were used last. A model with one candidate has 4."""


class CompiledNetworks:
    """A folder of networks. Safe for several threads and processes."""

    def __init__(self, folder: Path | None) -> None:
        """None: nothing is kept. The folder is made with the first file."""
        self._folder = folder

    @property
    def are_kept(self) -> bool:
        """Whether there is a folder."""
        return self._folder is not None

    def find(self, *about: object) -> NDArray[np.uint8] | None:
        """The bytes that were kept under this description, or None."""
        if self._folder is None:
            return None
        path = self._path(about)
        try:
            content = np.fromfile(path, np.uint8)
        except FileNotFoundError:
            return None
        except OSError as error:
            log.warning("a compiled network cannot be read", file=str(path), error=str(error))
            return None
        size = hashlib.sha256().digest_size
        body = content[size:]
        if hashlib.sha256(body.data).digest() != content[:size].tobytes():
            log.warning("a compiled network is damaged, and compiled again", file=str(path))
            return None
        with suppress(OSError):
            os.utime(path)  # it was used
        return body

    def keep(self, body: bytes, *about: object) -> None:
        """Keep bytes under a description; what was used longest ago goes."""
        if self._folder is None:
            return
        try:
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=self._folder, delete=False) as unfinished:
                try:
                    unfinished.write(hashlib.sha256(body).digest())
                    unfinished.write(body)
                    unfinished.close()
                    Path(unfinished.name).replace(self._path(about))
                except BaseException:
                    unfinished.close()
                    Path(unfinished.name).unlink(missing_ok=True)
                    raise
            self._tidy(self._folder)
        except OSError as error:
            log.warning("a compiled network cannot be kept", error=str(error))

    def _path(self, about: tuple[object, ...]) -> Path:
        assert self._folder is not None
        return self._folder / (hashlib.sha256(repr(about).encode()).hexdigest()[:32] + SUFFIX)

    @staticmethod
    def _tidy(folder: Path) -> None:
        files = sorted(folder.glob(f"*{SUFFIX}"), key=lambda path: path.stat().st_mtime)
        for path in files[:-MOST]:
            path.unlink(missing_ok=True)
