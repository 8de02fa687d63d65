"""What this process has started, and what that has started: Ray's processes and the nodes.

On Linux only: elsewhere nothing is found, and Ray kills a node when its keeper ends.
"""

import contextlib
import ctypes
import os
import signal
import sys
import time
from collections.abc import Collection
from pathlib import Path
from typing import Final

import structlog

from wayfarer.cluster.keeper import COMMAND

log = structlog.get_logger(__name__)

SET_CHILD_SUBREAPER: Final = 36  # of prctl(2)
LOOK_S: Final = 0.05
KILLED_S: Final = 2.0
"""Within which a killed process has ended."""


def adopt_orphans() -> None:
    """Have what loses its parent as a child: also a node whose keeper was killed."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def descendants() -> dict[int, bool]:
    """Those that run, and whether each is a node. What a node has started is not among them."""
    parents = dict[int, list[int]]()
    for file in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it has just ended
            state, parent = file.read_text().rpartition(")")[2].split()[:2]
            if state != "Z":
                parents.setdefault(int(parent), []).append(int(file.parent.name))
    found, waiting = dict[int, bool](), parents.get(os.getpid(), [])
    while waiting:
        pid = waiting.pop()
        found[pid] = _is_node(pid)
        if not found[pid]:
            waiting += parents.get(pid, [])
    return found


def end_descendants(patience_s: float, spared: Collection[int] = ()) -> None:
    """Let nodes drain for so long, and kill all others; return when all have ended.

    Whatever had to be killed as a node, or lives on, is told in one line of the log.
    """
    asked, killed = set[int](), set[int]()
    ends_at = time.monotonic() + patience_s
    while left := {pid: node for pid, node in descendants().items() if pid not in spared}:
        late = time.monotonic() - ends_at
        if late > KILLED_S:
            break
        for pid, is_node in left.items():
            if late > 0 or not is_node:
                _send(pid, signal.SIGKILL)
                killed |= {pid} if is_node else set()
            elif pid not in asked:
                _send(pid, signal.SIGTERM)
                asked.add(pid)
        time.sleep(LOOK_S)
    if killed or left:
        log.error("nodes killed, since they did not end", pids=sorted(killed), left=sorted(left))


def _is_node(pid: int) -> bool:
    with contextlib.suppress(OSError):
        told = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace")
        return told.rstrip("\0").split("\0")[1:] == list(COMMAND[1:])
    return False


def _send(pid: int, number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, number)
