"""One training run in a folder: checkpoints, resume, logs, a progress bar, a time limit.

    runs/<name>/config.json    what was asked for
    runs/<name>/last.pt        model, optimiser, step, random state, and what else the training
                               has to remember (written atomically)
    runs/<name>/effort.json    steps and minutes of processor time so far, all parts of the run
    runs/<name>/tensorboard/   curves

Ctrl-C, `kill` or the time limit lets the present step end and writes `last.pt`; the same command
resumes from it. A second Ctrl-C or `kill` breaks the step off.
"""

import json
import math
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar

import torch
from pydantic import BaseModel
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from torch import Tensor, nn
from torch.optim import Optimizer
from torch.utils.tensorboard import SummaryWriter

from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer.motion.policy import GoalPolicy, Policy, fitting_policy
from wayfarer.motion.predictor import MarkerPredictor

Network = TypeVar("Network", bound=nn.Module)


class Effort(BaseModel):
    """The effort of a run so far."""

    steps: int
    cpu_minutes: float | None  # of all threads together; None: part of it was not counted
    of: int | None = None  # steps in all; None: a run of a time when that was not noted


def read_effort(folder: Path) -> Effort | None:
    """The effort of a run; None for a run of a time when it was not counted, or for weights that
    were unpacked. Raises ArtifactError when it cannot be read.
    """
    path = folder / "effort.json"
    if not path.exists():
        return None
    try:
        return Effort.model_validate_json(path.read_text())
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{path}: cannot be read: {error}") from error


class TrainingRun:
    """Drives `steps` optimiser steps, resuming where the folder's checkpoint stands."""

    def __init__(
        self,
        folder: Path,
        config: BaseModel,
        model: nn.Module,
        optimizer: Optimizer,
        others: Mapping[str, nn.Module | Optimizer] | None = None,
    ) -> None:
        """`others` are saved and resumed with them, by name: a critic and its optimiser."""
        self.folder = folder
        self.others = dict(others or {})
        self.model = model
        self.optimizer = optimizer
        self.step = 0
        self.steps: int | None = None  # in all, once it is driven
        self.cpu_seconds = 0.0
        self._counted = time.process_time()
        folder.mkdir(parents=True, exist_ok=True)
        self._check_config(config)
        self.board = SummaryWriter(str(folder / "tensorboard"))
        if (folder / "last.pt").exists():
            self._load()

    def _check_config(self, config: BaseModel) -> None:
        """A folder belongs to one configuration: resuming with another would mix two trainings.

        A setting that a run's folder does not know yet had its default value.
        """
        path, wanted = self.folder / "config.json", config.model_dump(mode="json")
        if path.exists():
            had = json.loads(path.read_text())
            for name, field in type(config).model_fields.items():
                usual = field.get_default(call_default_factory=True)
                if name not in had and getattr(config, name) == usual:
                    had[name] = wanted[name]
            changed = sorted(k for k in {*had, *wanted} if had.get(k) != wanted.get(k))
            if changed:
                raise InvalidArgument(
                    f"{path} was made with other values of {changed}; "
                    "choose another folder to start a new training"
                )
        path.write_text(json.dumps(wanted, indent=2) + "\n")

    def _load(self) -> None:
        state = torch.load(self.folder / "last.pt", weights_only=True)
        self.model.load_state_dict(state["model"])
        self.optimizer.load_state_dict(state["optimizer"])
        for name, other in self.others.items():
            if name not in state:
                raise ArtifactError(f"{self.folder / 'last.pt'}: holds no {name!r} to go on from")
            other.load_state_dict(state[name])
        self.step = state["step"]
        self.cpu_seconds = state.get("cpu_seconds", math.nan)  # of an older run nobody knows
        torch.set_rng_state(state["rng"])

    def save(self) -> None:
        """Writes the checkpoint; a crash while writing leaves the old one whole."""
        now = time.process_time()
        self.cpu_seconds += now - self._counted
        self._counted = now
        state = {
            "model": self.model.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "step": self.step,
            "cpu_seconds": self.cpu_seconds,
            "rng": torch.get_rng_state(),
        } | {name: other.state_dict() for name, other in self.others.items()}
        torch.save(state, self.folder / "last.tmp")
        (self.folder / "last.tmp").rename(self.folder / "last.pt")
        known = not math.isnan(self.cpu_seconds)
        effort = Effort(
            steps=self.step,
            cpu_minutes=round(self.cpu_seconds / 60, 1) if known else None,
            of=self.steps,
        )
        (self.folder / "effort.json").write_text(effort.model_dump_json(indent=2) + "\n")

    def log(self, **values: float) -> None:
        """Scalars for TensorBoard at the current step."""
        for name, value in values.items():
            self.board.add_scalar(name, value, self.step)

    def drive(
        self,
        steps: int,
        update: Callable[[], dict[str, float]],
        validate: Callable[[], dict[str, float]],
        minutes: float = float("inf"),
        every: int = 500,
    ) -> bool:
        """Calls `update` until `steps` are done (True) or `minutes` have passed (False).

        Raises KeyboardInterrupt at the end of the step in which a signal came.
        """
        until = time.monotonic() + 60 * minutes
        self.steps = steps
        shown: dict[str, float] = {}
        try:
            with _progress() as bar, _signals(bar) as signals:
                task = bar.add_task(self.folder.name, total=steps, completed=self.step, note="")
                while self.step < steps and time.monotonic() < until and not signals:
                    losses = update()
                    self.step += 1
                    if self.step % 50 == 0:
                        self.log(**losses)
                    if self.step % every == 0 or self.step == steps:
                        shown = validate()
                        self.log(**shown)
                        self.save()
                        print_line(self.folder, self.step, losses | shown)
                    bar.update(task, completed=self.step, note=_note(losses | shown))
        finally:
            self.save()
            self.board.flush()
        if signals:
            raise KeyboardInterrupt
        return self.step >= steps


@contextmanager
def _signals(bar: Progress) -> Iterator[list[int]]:
    """The signals to stop that have come; the second one raises KeyboardInterrupt.

    An exception inside torch's backward pass would print a warning as of a faulty network. A shell
    lets its background jobs ignore Ctrl-C, and `kill` would skip the last checkpoint.
    """
    came: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        if came:
            raise KeyboardInterrupt
        came.append(number)
        bar.console.print("stopping after this step; once more breaks it off")

    before = {name: signal.signal(name, stop) for name in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield came
    finally:
        for name, handler in before.items():
            signal.signal(name, handler)


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
        refresh_per_second=2,
    )


def _note(values: dict[str, float]) -> str:
    return " ".join(f"{k} {v:.4g}" for k, v in values.items())


def print_line(folder: Path, step: int, values: dict[str, float]) -> None:
    """Appends one line to the run's plain log, for a terminal with `tail -f`."""
    with (folder / "log.txt").open("a") as log:
        log.write(f"{time.strftime('%H:%M:%S')} step {step} {_note(values)}\n")


WARMUP = 200
"""Steps of the learning rate's warm-up, in trainings that are long enough for it."""


def cosine_rate(base: float, step: int, steps: int, warmup: int | None = None) -> float:
    """Learning rate: linear warm-up over at most a tenth of the steps, then a half cosine to zero.

    Raises InvalidArgument when a longer `warmup` is asked for: the rate would hardly be reached.
    """
    most = steps // 10
    warmup = min(WARMUP, most) if warmup is None else warmup
    if warmup > most:
        raise InvalidArgument(
            f"a warm-up of {warmup} steps is more than a tenth of {steps} steps", "warmup"
        )
    if step < warmup:
        return base * (step + 1) / warmup
    return base * 0.5 * (1 + math.cos(math.pi * (step - warmup) / max(1, steps - warmup)))


def read_run_config(folder: Path) -> dict[str, Any]:
    """Settings that a run was trained with. Raises ArtifactError."""
    try:
        config: dict[str, Any] = json.loads((folder / "config.json").read_text())
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{folder / 'config.json'}: cannot be read: {error}") from error
    return config


def load_weights(model: Network, folder: Path) -> Network:
    """`read_weights` into `model`. Raises ArtifactError."""
    model.load_state_dict(read_weights(folder))
    return model.eval()


def load_predictor(folder: Path, seed_frames: int) -> MarkerPredictor:
    """The predictor of a run. Raises ArtifactError."""
    return load_weights(MarkerPredictor.fitting(read_weights(folder), seed_frames), folder)


def load_policy(folder: Path) -> Policy:
    """The policy of a run, of either kind. Raises ArtifactError."""
    return load_weights(fitting_policy(read_weights(folder)), folder)


def load_goal_policy(folder: Path) -> GoalPolicy:
    """The paper's kind of policy, with its critic. Raises ArtifactError for another."""
    return load_weights(GoalPolicy.fitting(read_weights(folder)), folder)


def read_weights(folder: Path) -> dict[str, Tensor]:
    """Weights of a run's last checkpoint: their moving average, if the run has one.

    Raises ArtifactError.
    """
    path = folder / "last.pt"
    if not path.exists():
        raise ArtifactError(f"no checkpoint {path}; train it first (wayfarer train --help)")
    state: dict[str, Any] = torch.load(path, weights_only=True)
    found: dict[str, Tensor] = state.get("average", state["model"])
    return found
