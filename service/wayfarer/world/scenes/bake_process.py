"""The process that bakes scenes: `python -m wayfarer.world.scenes.bake_process MEGABYTES SECONDS`.

It reads specs from its parent (bake_queue.py) and answers each with the scene or the error. Both
are pickled, which is safe between these two processes. It sends True once it is ready, and ends
with its parent, even when that is killed.
"""

import contextlib
import os
import pickle
import sys
import threading
from math import ceil
from pathlib import Path
from queue import SimpleQueue
from time import process_time
from traceback import format_exception
from typing import BinaryIO, Final

from wayfarer.errors import WayfarerError
from wayfarer.navigation.scene import bake
from wayfarer.navigation.scene_spec import Floor, SceneSpec

NICE: Final = 10
SQUARE: Final = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
EVERYTHING: Final = SceneSpec((Floor(SQUARE), Floor(SQUARE, height=3.0)))
"""Baking this loads every library that a bake may need."""


def main(megabytes: int, seconds: float) -> None:
    """Bakes each spec that comes until the other end is closed."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # a library's output must not be an answer
    bound_memory(megabytes)
    specs: SimpleQueue[SceneSpec] = SimpleQueue()
    threading.Thread(target=_listen, args=(sys.stdin.buffer, specs), daemon=True).start()
    bake(EVERYTHING)
    step_back()  # not before: on a busy machine it would hardly begin
    _answer(answers, pickle.dumps(True))
    while True:
        spec = specs.get()
        bound_time(seconds)
        _answer(answers, baked(spec))


def step_back() -> None:
    """Gives way to all other processes, and dies first when the system is short of memory."""
    if hasattr(os, "nice"):
        os.nice(NICE)
    with contextlib.suppress(OSError):  # only Linux has it
        Path("/proc/self/oom_score_adj").write_text("1000")


def bound_memory(megabytes: int) -> None:
    """Makes allocations beyond the limit fail. Linux counts all written memory, others less."""
    try:
        import resource
    except ImportError:  # Windows
        return
    most = megabytes << 20
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def bound_time(seconds: float) -> None:
    """Makes the process end by SIGXCPU once it has been busy for this much longer."""
    try:
        import resource
    except ImportError:  # Windows
        return
    until = ceil(process_time() + seconds)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (until, resource.RLIM_INFINITY))


def baked(spec: SceneSpec) -> bytes:
    """The scene or the error, pickled; MemoryError itself if memory does not suffice."""
    try:
        return pickle.dumps(bake(spec), pickle.HIGHEST_PROTOCOL)
    except WayfarerError as error:
        return pickle.dumps(error)
    except Exception as error:
        if isinstance(error, MemoryError) or "bad_alloc" in str(error):  # of GEOS
            return pickle.dumps(MemoryError())
        return pickle.dumps(RuntimeError("".join(format_exception(error))))


def _listen(stream: BinaryIO, specs: "SimpleQueue[SceneSpec]") -> None:
    """Ends the process together with its parent, at any time."""
    while True:
        try:
            specs.put(pickle.load(stream))
        except (EOFError, OSError, pickle.UnpicklingError):
            os._exit(0)


def _answer(stream: BinaryIO, answer: bytes) -> None:
    stream.write(answer)
    stream.flush()


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
