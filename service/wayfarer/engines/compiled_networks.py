"""Compiled networks as files: the next start reads them in a third of the time.

A file's name is a hash of all that its network depends on, so a file of another version, model
or machine is never found; its content begins with a hash of the rest, so a damaged one is never
run. If the folder cannot be read or written, only the saved time is lost.
"""

import hashlib
import mmap
import os
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import IO, Final

import numpy as np
import structlog
from numpy.typing import NDArray

log = structlog.get_logger(__name__)

SUFFIX: Final = ".network"
HASH_BYTES: Final = hashlib.sha256().digest_size

MOST: Final = 32
"""Number of files kept, 24 MB each: the ones used last. A model with one candidate has 4."""


class KeptNetwork:
    """A stored network. Its bytes stay in the file, and memory holds only the pages in use."""

    def __init__(self, file: IO[bytes]) -> None:
        """The file may be closed, and removed. Raises OSError, or ValueError for an empty file."""
        # OpenVINO accepts only writable memory, though it never writes
        self._mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)
        content = np.frombuffer(self._mapped, np.uint8)
        self._hash = content[:HASH_BYTES].tobytes()
        self.body: NDArray[np.uint8] = content[HASH_BYTES:]

    @property
    def is_whole(self) -> bool:
        """Whether these are the bytes that were kept."""
        return hashlib.sha256(self.body.data).digest() == self._hash

    def release(self) -> None:
        """Gives the memory back. Later reads come from the file."""
        if hasattr(mmap, "MADV_DONTNEED"):  # not on Windows
            self._mapped.madvise(mmap.MADV_DONTNEED)


class CompiledNetworks:
    """A folder of networks. Safe for several threads and processes."""

    def __init__(self, folder: Path | None) -> None:
        """None: nothing is found again. The folder is made with the first file."""
        self._folder = folder

    def find(self, *about: object) -> KeptNetwork | None:
        """The network stored under this description, or None."""
        if self._folder is None:
            return None
        path = self._path(about)
        try:
            with path.open("rb") as file:
                found = KeptNetwork(file)
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            log.warning("a compiled network cannot be read", file=str(path), error=str(error))
            return None
        if not found.is_whole:
            log.warning("a compiled network is damaged, and compiled again", file=str(path))
            return None
        with suppress(OSError):
            os.utime(path)  # marks the file as used
        return found

    def keep(self, body: bytes, *about: object) -> KeptNetwork | None:
        """Stores bytes under a description; the file used longest ago goes.

        Without a folder they are kept in a file without a name, which goes with the process. None
        when no file can be written.
        """
        try:
            if self._folder is None:
                with tempfile.TemporaryFile() as nameless:
                    return _written(nameless, body)
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=self._folder, delete=False) as unfinished:
                try:
                    kept = _written(unfinished, body)
                    unfinished.close()
                    Path(unfinished.name).replace(self._path(about))
                except BaseException:
                    unfinished.close()
                    Path(unfinished.name).unlink(missing_ok=True)
                    raise
            self._tidy(self._folder)
            return kept
        except OSError as error:
            log.warning("a compiled network cannot be kept", error=str(error))
            return None

    def _path(self, about: tuple[object, ...]) -> Path:
        assert self._folder is not None
        return self._folder / (hashlib.sha256(repr(about).encode()).hexdigest()[:32] + SUFFIX)

    @staticmethod
    def _tidy(folder: Path) -> None:
        files = sorted(folder.glob(f"*{SUFFIX}"), key=lambda path: path.stat().st_mtime)
        for path in files[:-MOST]:
            path.unlink(missing_ok=True)


def _written(file: IO[bytes], body: bytes) -> KeptNetwork:
    file.write(hashlib.sha256(body).digest())
    file.write(body)
    file.flush()
    return KeptNetwork(file)
