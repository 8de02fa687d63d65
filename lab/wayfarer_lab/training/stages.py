"""`wayfarer train all`: a list of commands, one after the other, that resumes where it stopped.

A stage is a command of `wayfarer`, run as a child process. A training is finished when its run
folder says so (`effort.json`), another command when the path `done` exists. The list's folder has
the minutes that each stage took (`stages.json`).
"""

import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from string import Template
from types import FrameType

from filelock import FileLock, Timeout
from pydantic import BaseModel, TypeAdapter

from wayfarer.errors import InvalidArgument
from wayfarer_lab.training.run import read_effort, read_run_config

Say = Callable[[str], None]
Training = tuple[Path, BaseModel]
"""The run folder and the settings of a `wayfarer train` command."""
POLL = 1.0
"""Seconds between looks at a running stage."""
TELL = 300.0
"""Seconds between lines about a running stage's progress, where no terminal shows its bar."""


class TrainingStage(BaseModel, extra="forbid"):
    """One command of the list."""

    name: str
    command: str  # what stands after `wayfarer`; $NAME is a value of the list
    done: str = ""  # path that exists once the command is finished; trainings need none
    minutes: float | None = None  # usual time on one core, for the time left until it is measured


class StageList(BaseModel, extra="forbid"):
    """A config of `wayfarer train all`."""

    folder: str  # of stages.json; $folder in commands
    values: dict[str, str | int | float] = {}
    stages: list[TrainingStage]


@dataclass(frozen=True)
class StageCommand:
    """A stage with its values in place."""

    name: str
    arguments: tuple[str, ...]
    training: Training | None
    done: Path | None
    minutes: float | None


class Taken(BaseModel):
    """What `stages.json` has of a stage."""

    minutes: float  # so far, of the clock
    command: str  # the last one


@dataclass(frozen=True)
class StageProgress:
    """How far a stage is."""

    finished: bool
    steps: int = 0
    of: int | None = None  # None: not known before it ends
    took: float | None = None  # minutes so far
    left: float | None = None  # minutes; None: nothing to judge by


RECORD = TypeAdapter(dict[str, Taken])


class Stages:
    """The stages of a list, with what is known of each."""

    def __init__(
        self,
        wanted: StageList,
        parse: Callable[[tuple[str, ...]], Training | None],
        program: tuple[str, ...] = (sys.executable, "-m", "wayfarer"),
    ) -> None:
        """`parse`: run folder and settings of a command's arguments; None if it is no training.

        Raises InvalidArgument that names the stage at fault, before anything runs.
        """
        self.folder = Path(wanted.folder)
        self.program = program
        values = {**wanted.values, "folder": wanted.folder}
        names = [stage.name for stage in wanted.stages]
        if len(set(names)) < len(names) or not names:
            raise InvalidArgument(
                "the list needs at least one stage, and different names", "stages"
            )
        self.steps = [_step(stage, values, parse) for stage in wanted.stages]

    def progress(self, running: str = "", minutes: float = 0.0) -> list[StageProgress]:
        """Returns the state of every stage; `running` has run for `minutes` not noted yet.

        Raises InvalidArgument if one was made with other settings.
        """
        record = self._record()
        found = []
        pace = _pace([(s.minutes, record[s.name].minutes) for s in self.steps if s.name in record])
        for step in self.steps:
            known = record.get(step.name)
            took = known.minutes if known else None
            if step.name == running:
                took = (took or 0.0) + minutes
            finished, steps, of = self._state(step, known.command if known else None)
            left: float | None = 0.0
            if not finished:
                left = None if step.minutes is None else step.minutes * pace
                if of and steps:
                    left = took * (of - steps) / steps if took else left and left * (1 - steps / of)
            found.append(StageProgress(finished, steps, of, took, left))
        return found

    def _state(self, step: StageCommand, before: str | None) -> tuple[bool, int, int | None]:
        if step.training is None:
            finished = step.done is not None and step.done.exists()
            if finished and before is not None and before != shlex.join(step.arguments):
                raise InvalidArgument(
                    f"{step.name}: {step.done} was made by another command, `wayfarer {before}`; "
                    "remove it, or give the list another folder",
                    "stages",
                )
            return finished, 0, None
        out, settings = step.training
        effort = read_effort(out) if out.exists() else None
        if effort is None:
            return False, 0, None
        had, wanted = read_run_config(out), settings.model_dump(mode="json")
        changed = sorted(k for k in had.keys() & wanted.keys() if had[k] != wanted[k])
        if changed:
            raise InvalidArgument(
                f"{step.name}: {out} was made with other values of {changed}; "
                "remove it, or give the list another folder",
                "stages",
            )
        finished = effort.of is not None and effort.steps >= effort.of
        return finished, effort.steps, effort.of

    def run(self, minutes: float, say: Say) -> bool:
        """Runs what is not finished, in order, until all is (True) or time is up (False).

        Ctrl-C and `kill` are passed on to the running stage, which writes its checkpoint; then
        KeyboardInterrupt is raised. Raises InvalidArgument if a stage fails or another process
        runs the list.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        until = time.monotonic() + 60 * minutes
        lock = FileLock(self.folder / "stages.lock")
        try:
            lock.acquire(timeout=0)
        except Timeout:
            message = f"another `wayfarer train all` runs in {self.folder}"
            raise InvalidArgument(message, "stages") from None
        with lock:
            for number, step in enumerate(self.steps, start=1):
                progress = self.progress()[number - 1]
                if progress.finished:
                    continue
                if time.monotonic() >= until:
                    return False
                left = _left(self.progress())
                say(f"stage {number} of {len(self.steps)}: {self._line(number - 1)}; {left}")
                self._run_step(step, number - 1, until, say)
                if not self.progress()[number - 1].finished:
                    if time.monotonic() >= until:
                        return False
                    missing = step.done or (step.training and step.training[0])
                    raise InvalidArgument(
                        f"{step.name}: its command ended, but {missing} is not finished", "stages"
                    )
        return True

    def _run_step(self, step: StageCommand, index: int, until: float, say: Say) -> None:
        command = [*self.program, *step.arguments]
        began, told = time.monotonic(), time.monotonic()
        # another process group: a terminal's Ctrl-C would reach it twice, which breaks its step off
        with _signals() as signals:
            stage = subprocess.Popen(command, process_group=0)
            passed = 0
            try:
                while stage.poll() is None:
                    if len(signals) > passed:
                        stage.send_signal(signals[passed])
                        passed += 1
                    elif not signals and time.monotonic() >= until:
                        signals.append(0)  # no signal: time is up
                        stage.send_signal(signal.SIGINT)
                        passed += 1
                    with suppress(subprocess.TimeoutExpired):
                        stage.wait(POLL)
                    if time.monotonic() - told > TELL and not sys.stdout.isatty():
                        told = time.monotonic()
                        say(self._line(index, (told - began) / 60))
            finally:
                if stage.poll() is None:
                    stage.kill()
                self._note(step, (time.monotonic() - began) / 60)
        if any(signals):
            raise KeyboardInterrupt
        if stage.returncode and not signals:
            raise InvalidArgument(
                f"{step.name}: `wayfarer {shlex.join(step.arguments)}` failed with exit code "
                f"{stage.returncode}",
                "stages",
            )

    def lines(self) -> list[str]:
        """The state of every stage, and the time left."""
        progress = self.progress()
        found = [f"{k + 1:2} {self._line(k)}" for k in range(len(self.steps))]
        return [*found, _left(progress)]

    def _line(self, index: int, more: float = 0.0) -> str:
        """A stage's state; `more` minutes of it are not noted yet."""
        step = self.steps[index]
        own = self.progress(step.name if more else "", more)[index]
        if own.finished:
            return f"{step.name}: done" + (f", {_time(own.took)}" if own.took else "")
        if not own.steps:
            return f"{step.name}: " + (f"about {_time(own.left)}" if own.left else "to do")
        share = f"{own.steps:,} of {own.of:,} steps" if own.of else f"{own.steps:,} steps"
        here = f", about {_time(own.left)} left here" if own.left else ""
        return f"{step.name}: {share}{here}"

    def _record(self) -> dict[str, Taken]:
        path = self.folder / "stages.json"
        try:
            return RECORD.validate_json(path.read_bytes()) if path.exists() else {}
        except (OSError, ValueError) as error:
            raise InvalidArgument(f"{path}: cannot be read: {error}", "stages") from None

    def _note(self, step: StageCommand, minutes: float) -> None:
        record = self._record()
        if step.name in record:
            minutes += record[step.name].minutes
        record[step.name] = Taken(minutes=round(minutes, 2), command=shlex.join(step.arguments))
        path = self.folder / "stages.json"
        path.with_suffix(".tmp").write_bytes(RECORD.dump_json(record, indent=1))
        path.with_suffix(".tmp").rename(path)


def _step(
    stage: TrainingStage,
    values: dict[str, str | int | float],
    parse: Callable[[tuple[str, ...]], Training | None],
) -> StageCommand:
    def filled(text: str) -> str:
        try:
            return Template(text).substitute(values)
        except (KeyError, ValueError) as error:
            known = ", ".join(values)
            raise InvalidArgument(
                f"{stage.name}: {text!r} asks for {error}; values are {known}", "stages"
            ) from None

    try:
        arguments = tuple(shlex.split(filled(stage.command)))
        training = parse(arguments)
    except (InvalidArgument, ValueError) as error:
        raise InvalidArgument(f"{stage.name}: {error}", "stages") from None
    if training is None and not stage.done:
        raise InvalidArgument(
            f"{stage.name}: `done` has to name what its command writes last", "stages"
        )
    done = Path(filled(stage.done)) if stage.done else None
    return StageCommand(stage.name, arguments, training, done, stage.minutes)


def _pace(known: list[tuple[float | None, float]]) -> float:
    """Taken over usual time of the stages of which both are known; 1 before."""
    both = [(usual, took) for usual, took in known if usual and took]
    total = sum(usual for usual, _ in both)
    return sum(took for _, took in both) / total if total else 1.0


def _left(progress: list[StageProgress]) -> str:
    waiting = [p for p in progress if not p.finished]
    if not waiting:
        return "all stages are done"
    known = sum(p.left for p in waiting if p.left is not None)
    unknown = sum(p.left is None for p in waiting)
    return f"about {_time(known)} left in all" + (
        f", not counting {unknown} without an estimate" if unknown else ""
    )


def _time(minutes: float) -> str:
    return f"{minutes / 60:.1f} h" if minutes >= 90 else f"{max(minutes, 1):.0f} min"


@contextmanager
def _signals() -> Iterator[list[int]]:
    """The signals to stop that have come."""
    came: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        came.append(number)

    before = {name: signal.signal(name, stop) for name in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield came
    finally:
        for name, handler in before.items():
            signal.signal(name, handler)
