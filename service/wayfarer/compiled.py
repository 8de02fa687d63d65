"""Compiled rules: numba makes machine code of them, once per machine.

The code is kept in the first of these folders that can be written: NUMBA_CACHE_DIR, beside the
sources, the user's cache folder. Without one, it is compiled again at every start. Each text of the
rule's file has its own folder: numba itself would take code of another release for this one's, or
fail to read it. So a compiled function uses nothing of the project that another file defines.
"""

import os
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

import numba
import structlog

log = structlog.get_logger(__name__)

OPTIONS: Final[dict[str, Any]] = {"nogil": True, "error_model": "numpy"}
"""Not `fastmath`: a result is the same in every batch, process and replay."""


def compiled(rule: Callable[..., Any]) -> Any:
    """A rule, compiled when it is first called with arguments of new types; see `warm`."""
    folder = _kept_in(Path(rule.__code__.co_filename))
    if folder is None:
        return numba.njit(**OPTIONS)(rule)
    config: Any = numba.config
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
    try:
        return numba.njit(cache=True, **OPTIONS)(rule)
    finally:
        config.CACHE_DIR = before


def warm(rule: Any, *arguments: Any) -> None:
    """Call a compiled rule once before it is needed, and log it if that takes seconds."""
    folder = rule.stats.cache_path
    if folder is None:
        log.info("compiling a rule; no folder can keep it: set NUMBA_CACHE_DIR", rule=rule.__name__)
    elif not any(Path(folder).glob(f"*.{rule.__name__}-*.nbi")):
        log.info("compiling a rule for this machine, once", rule=rule.__name__, kept_in=folder)
    rule(*arguments)


def _kept_in(file: Path) -> Path | None:
    """The folder for the code of a file's rules; None: no folder can be written."""
    text = file.read_bytes() + Path(__file__).read_bytes()
    for base in _bases(file):
        folder = base / f"wayfarer-{sha256(text).hexdigest()[:16]}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return None


def _bases(file: Path) -> Iterator[Path]:
    if asked := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(asked)
    yield file.parent / "__pycache__"
    try:
        yield Path.home() / ".cache"
    except RuntimeError:  # the user has no home
        return
