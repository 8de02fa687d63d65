"""Fit many clips, in worker processes, with finished clips kept in a cache.

A finished clip is stored under a hash of all that it depends on (motion, contacts, shape,
options, body), so an interrupted or repeated run fits only what is missing.
"""

import hashlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, fields
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import torch

from wayfarer.body.model import BodyModel
from wayfarer_lab.training.mocap.fit import FitOptions, FittedClip, Fitter
from wayfarer_lab.training.mocap.retarget import FitProblem
from wayfarer_lab.training.mocap.skeleton import Array
from wayfarer_lab.training.mocap.store import atomically

BATCH_FRAMES = 4096  # enough to keep a core busy; more does not fit its cache
FIT_VERSION = 7  # part of the cache key: raise it when the fit itself changes
_STORED = ("translation", "rotations", "joint_error")


@dataclass(frozen=True)
class Fits:
    """A fitted clip, and the pose that the fit began with (copied rotations)."""

    fitted: FittedClip
    copied: FittedClip


def body_fingerprint(body: BodyModel) -> str:
    """Hash of the arrays of a body that a fit depends on."""
    digest = hashlib.sha256(body.name.encode())
    for array in (body.bind_joints, body.bind_joints_dirs, body.bind_vertices, body.bind_to_rest):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:16]


def problem_key(problem: FitProblem, options: FitOptions, body: str) -> str:
    """Hash of everything that a fit depends on; `body` is the body's fingerprint."""
    digest = hashlib.sha256(f"{FIT_VERSION}|{problem.shape.gender}|{options}|{body}".encode())
    digest.update(np.ascontiguousarray(problem.shape.betas).tobytes())
    for field in fields(problem):
        value = getattr(problem, field.name)
        if isinstance(value, np.ndarray):
            digest.update(np.ascontiguousarray(value).tobytes())
    return digest.hexdigest()[:24]


def batches(problems: list[tuple[str, FitProblem]]) -> Iterator[list[tuple[str, FitProblem]]]:
    """Keyed problems of one gender, together about `BATCH_FRAMES` long."""
    for gender in sorted({p.shape.gender for _, p in problems}):
        batch: list[tuple[str, FitProblem]] = []
        frames = 0
        for key, problem in ((k, p) for k, p in problems if p.shape.gender == gender):
            if batch and frames + len(problem) > BATCH_FRAMES:
                yield batch
                batch, frames = [], 0
            batch.append((key, problem))
            frames += len(problem)
        if batch:
            yield batch


def fit_batch(
    batch: list[tuple[str, FitProblem]], body: BodyModel, options: FitOptions, cache: Path
) -> int:
    """Fits one batch and stores each clip. Returns the number of frames."""
    fitter = Fitter(body, options)
    problems = [p for _, p in batch]
    copied = fitter.fit(problems, refine=False)
    fitted = fitter.fit(problems)
    for (key, _), before, after in zip(batch, copied, fitted, strict=True):
        arrays = {f"copied_{n}": getattr(before, n) for n in _STORED}
        arrays |= {f"fitted_{n}": getattr(after, n) for n in _STORED}
        atomically(cache / f"{key}.npz", partial(_save, arrays))
    return sum(len(p) for p in problems)


def _save(arrays: dict[str, Array], path: Path) -> None:
    np.savez(path, **arrays)  # type: ignore[arg-type]


def load_fits(key: str, problem: FitProblem, cache: Path) -> Fits:
    """The stored result of a problem."""
    with np.load(cache / f"{key}.npz") as file:
        clips = [
            FittedClip(
                info=problem.info,
                shape=problem.shape,
                touch=problem.touch,
                use=problem.use,
                **{n: file[f"{stage}_{n}"] for n in _STORED},
            )
            for stage in ("fitted", "copied")
        ]
    return Fits(*clips)


def fit_all(
    problems: list[FitProblem],
    bodies: dict[str, BodyModel],
    options: FitOptions,
    cache: Path,
    workers: int,
    progress: Callable[[int], None],
) -> list[Fits]:
    """Fit clips that are not cached; `progress` gets the frames done. Ctrl-C keeps done batches."""
    cache.mkdir(parents=True, exist_ok=True)
    prints = {gender: body_fingerprint(body) for gender, body in bodies.items()}
    keyed = [(problem_key(p, options, prints[p.shape.gender]), p) for p in problems]
    todo = [(k, p) for k, p in keyed if not (cache / f"{k}.npz").exists()]
    progress(sum(map(len, problems)) - sum(len(p) for _, p in todo))
    if workers <= 1:
        for batch in batches(todo):
            progress(fit_batch(batch, bodies[batch[0][1].shape.gender], options, cache))
    elif todo:
        pool = ProcessPoolExecutor(workers, get_context("spawn"), initializer=_start_worker)
        try:
            futures = [
                pool.submit(fit_batch, b, bodies[b[0][1].shape.gender], options, cache)
                for b in batches(todo)
            ]
            for future in as_completed(futures):
                progress(future.result())
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
    return [load_fits(key, problem, cache) for key, problem in keyed]


def _start_worker() -> None:
    """Gives a worker one core, leaves Ctrl-C to its parent, and ends it with a killed parent."""
    torch.set_num_threads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_leave_with, args=(os.getppid(),), daemon=True).start()


def _leave_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(1)
    os._exit(1)
