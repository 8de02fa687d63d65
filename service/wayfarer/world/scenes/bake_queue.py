"""Bakes in a separate process: limited in time and memory, and without delaying other work.

A client's geometry decides the cost of a bake. In the server's own process a hostile one would keep
the motion thread from running Python, and take memory that is not returned.
"""

import contextlib
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from threading import Event, Lock, Timer
from typing import Any, Final

import structlog

from wayfarer.config.limits import Limits
from wayfarer.errors import ResourceExhausted, Unavailable
from wayfarer.navigation.scene import Scene
from wayfarer.navigation.scene_spec import SceneSpec

log = structlog.get_logger(__name__)

COMMAND: Final = (sys.executable, "-m", "wayfarer.world.scenes.bake_process")
START_S: Final = 60.0
"""Seconds until the process can begin, on a busy machine."""
PATIENCE: Final = 3
"""Ratio of the wall time a bake may take to its CPU time: it has the lowest priority."""
ONE_THREAD: Final = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Environment of the process: the memory of threads would count."""
ADVICE: Final = (
    "leave out what nobody can stand on or bump into, use fewer and simpler outlines, or make "
    "several scenes of it"
)


class BakeQueue:
    """One process, started for the first bake and kept. Thread-safe; one bake at a time."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._turn = Lock()
        self._starting = Lock()  # no process starts after `stop`
        self._worker: BakeWorker | None = None
        self._closed = False

    @property
    def pid(self) -> int | None:
        """Id of the process; None before the first bake."""
        return self._worker.pid if self._worker else None

    def bake(self, spec: SceneSpec) -> Scene:
        """Returns the result of `navigation.scene.bake`. Takes time.

        Raises the same; ResourceExhausted if it takes too much time or memory, Unavailable after
        `stop`.
        """
        with self._turn:
            answer = self._baked(spec)
        if isinstance(answer, Exception):
            raise answer
        return replace(answer, spec=spec)

    def stop(self) -> None:
        """Ends the process, and so the bake in progress."""
        with self._starting:
            self._closed = True
            if self._worker:
                self._worker.kill()

    def _baked(self, spec: SceneSpec) -> Scene | Exception:
        worker = self._started()
        try:
            answer: Scene | Exception = worker.ask(spec, PATIENCE * self._limits.bake_s)
        except BakeWorkerError as ended:
            return self._why(ended)
        if isinstance(answer, MemoryError):
            worker.kill()  # its memory is returned
            return self._too_large()
        return answer

    def _started(self) -> "BakeWorker":
        """The running process, or a new one."""
        if self._worker and self._worker.is_running:
            return self._worker
        with self._starting:
            if self._closed:
                raise Unavailable("the server is stopping")
            worker = self._worker = BakeWorker(
                (*COMMAND, str(self._limits.bake_mb), str(self._limits.bake_s))
            )
        try:
            worker.await_answer(START_S)
        except BakeWorkerError as ended:
            why = (
                f"within {START_S:g} s: the machine is too busy"
                if ended.late
                else f"({ended}); the server's log may say why"
            )
            raise Unavailable(f"the process that bakes scenes did not start {why}") from None
        return worker

    def _why(self, ended: "BakeWorkerError") -> Exception:
        if self._closed:
            return Unavailable("the server is stopping")
        if ended.late:
            return ResourceExhausted(
                f"making the scene takes more than {self._limits.bake_s:g} s of a processor's time "
                f"(limits.bake_s): {ADVICE}"
            )
        log.error("the process that makes scenes ended", why=str(ended))
        return ResourceExhausted(
            f"the process that was making the scene ended ({ended}), most likely for want of "
            f"memory: {ADVICE}"
        )

    def _too_large(self) -> Exception:
        return ResourceExhausted(
            f"making the scene takes more than {self._limits.bake_mb:,} MB of memory "
            f"(limits.bake_mb): {ADVICE}"
        )


class BakeWorkerError(Exception):
    """The process has ended. `late`: because it took too long."""

    def __init__(self, code: int, late: bool) -> None:
        super().__init__(f"signal {-code}" if code < 0 else f"exit code {code}")
        self.late = late or -code == getattr(signal, "SIGXCPU", None)


class BakeWorker:
    """The process (bake_process.py) as its parent sees it."""

    def __init__(self, command: tuple[str, ...]) -> None:
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **ONE_THREAD},
            process_group=0,  # a terminal's Ctrl-C is only for the parent
        )
        assert self._process.stdin is not None and self._process.stdout is not None
        self._to, self._from = self._process.stdin, self._process.stdout

    @property
    def pid(self) -> int:
        """Id of the process."""
        return self._process.pid

    @property
    def is_running(self) -> bool:
        """Whether the process runs."""
        return self._process.poll() is None

    def ask(self, question: object, seconds: float) -> Any:
        """The answer of the process. Raises BakeWorkerError."""
        return self._within(seconds, lambda: self._put(question))

    def await_answer(self, seconds: float) -> Any:
        """The next message of the process. Raises BakeWorkerError."""
        return self._within(seconds, lambda: None)

    def kill(self) -> None:
        """Ends the process, if it runs."""
        self._process.kill()
        self._process.wait()

    def _put(self, question: object) -> None:
        pickle.dump(question, self._to, pickle.HIGHEST_PROTOCOL)
        self._to.flush()

    def _within(self, seconds: float, begin: Callable[[], None]) -> Any:
        late = Event()

        def give_up() -> None:
            late.set()
            self._process.kill()

        timer = Timer(seconds, give_up)
        timer.daemon = True
        timer.start()
        try:
            begin()
            answer = pickle.load(self._from)
        except (EOFError, OSError, pickle.UnpicklingError):
            answer = None
        timer.cancel()
        timer.join()
        if answer is None or late.is_set():
            self._close()
            raise BakeWorkerError(self._process.returncode, late.is_set())
        return answer

    def _close(self) -> None:
        self.kill()
        with contextlib.suppress(OSError):  # unread input
            self._to.close()
        self._from.close()
