"""Compiled rules: numba compiles them to machine code, once per machine.

The code is kept in the first of these folders that can be written: NUMBA_CACHE_DIR, the sources'
folder, the user's cache folder. If none can, it is compiled at every start. Each version of the
rule's file, of the files whose rules it uses, and of the constants that it imports has a separate
folder, since numba itself would mistake code of another release for this one's.
"""

import os
from collections.abc import Callable, Iterator
from functools import partial
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numba
import numpy as np
import structlog
from filelock import FileLock
from numba.core.dispatcher import Dispatcher

log = structlog.get_logger(__name__)

OPTIONS: Final[dict[str, Any]] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""Not `fastmath`: a result is the same in every batch, process and replay."""


def compiled(rule: Callable[..., Any], **more: bool) -> Any:
    """A rule, compiled when it is first called with arguments of new types; see `warm`."""
    folder, njit = _kept_in(rule), partial(numba.njit, **OPTIONS, **more)
    if folder is None:
        return njit(rule)
    config: Any = numba.config
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
    try:
        return njit(rule, cache=True)
    finally:
        config.CACHE_DIR = before


def inner(rule: Callable[..., Any]) -> Any:
    """A part of other compiled rules, for which code to call it from Python, or from each other,
    would take as long to compile again. A call from Python ends the process.
    """
    return compiled(rule, no_cpython_wrapper=True, forceinline=True)


def warm(rule: Any, *arguments: Any) -> None:
    """Calls a compiled rule once before it is needed, and logs it if that takes seconds.
    When processes start together, one compiles the rule and the others wait for its code.
    """
    folder = rule.stats.cache_path
    if folder is None:
        log.info("compiling a rule; no folder can keep it: set NUMBA_CACHE_DIR", rule=rule.__name__)
    elif not _has_code(rule):
        with FileLock(Path(folder).parent / f"{rule.__name__}.lock"):
            if not _has_code(rule):  # else another process has compiled it meanwhile
                about = {"rule": rule.__name__, "kept_in": folder}
                log.info("compiling a rule for this machine, once", **about)
            rule(*arguments)
        return
    rule(*arguments)


def is_kept(module: ModuleType) -> bool:
    """Whether the code of all rules that a module uses is kept, or no folder can keep it."""
    rules = [value for value in vars(module).values() if isinstance(value, Dispatcher)]
    return all(rule.stats.cache_path is None or _has_code(rule) for rule in rules)


def _has_code(rule: Any) -> bool:
    return any(Path(rule.stats.cache_path).glob(f"*.{rule.__name__}-*.nbi"))


def _kept_in(rule: Callable[..., Any]) -> Path | None:
    """The folder for the code of a file's rules; None: no folder can be written."""
    name = f"wayfarer-{sha256(_text(rule)).hexdigest()[:16]}"
    for base in _bases(Path(rule.__code__.co_filename)):
        folder = base / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return None


def _text(rule: Callable[..., Any]) -> bytes:
    """Everything that determines the code of a file's rules."""
    parts, files, rules = [Path(__file__).read_bytes()], set[str](), [rule]
    while rules:
        rule = rules.pop()
        file = rule.__code__.co_filename
        if file in files:
            continue
        files.add(file)
        parts.append(Path(file).read_bytes())
        for name, value in sorted(rule.__globals__.items()):
            if isinstance(value, Dispatcher):
                rules.append(value.py_func)
            elif isinstance(value, int | float | tuple) and not name.startswith("__"):
                parts.append(f"{name} = {value!r}".encode())
            elif isinstance(value, np.ndarray):
                parts.append(name.encode() + value.tobytes())
    return b"".join(parts)


def _bases(file: Path) -> Iterator[Path]:
    if asked := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(asked)
    yield file.parent / "__pycache__"
    try:
        yield Path.home() / ".cache"
    except RuntimeError:  # the user has no home
        return
