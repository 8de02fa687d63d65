"""Compiled rules: numba makes machine code of them, once per machine.

The code is kept where the first of these can be written: NUMBA_CACHE_DIR, beside the sources, the
user's cache folder. Where none can, it is made anew at every start. A cache knows a rule by the
text of its own file alone, so a compiled function uses nothing that another file defines.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import structlog
from numba import njit

log = structlog.get_logger(__name__)

OPTIONS: Final[dict[str, Any]] = {"nogil": True, "error_model": "numpy"}
"""Not `fastmath`: a result is the same in every batch, process and replay."""


def compiled(rule: Callable[..., Any]) -> Any:
    """A rule, compiled when it is first called with arguments of new types; see `warm`."""
    try:
        return njit(cache=True, **OPTIONS)(rule)
    except RuntimeError:  # there is no folder that can be written
        return njit(**OPTIONS)(rule)


def warm(rule: Any, *arguments: Any) -> None:
    """Call a compiled rule once before anybody waits for it, and say so where it takes seconds."""
    folder = rule.stats.cache_path
    if folder is None:
        log.info("compiling a rule; no folder can keep it: set NUMBA_CACHE_DIR", rule=rule.__name__)
    elif not any(Path(folder).glob(f"*.{rule.__name__}-*.nbi")):
        log.info("compiling a rule for this machine, once", rule=rule.__name__, kept_in=folder)
    rule(*arguments)
