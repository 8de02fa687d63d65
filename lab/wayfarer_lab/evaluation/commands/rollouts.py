"""Tables of open rollouts: random motion from a start pose."""

from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from wayfarer.body.library import SHIPPED, load_body
from wayfarer.errors import InvalidArgument
from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer.spec import FPS
from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.commands import options
from wayfarer_lab.evaluation.commands.shared import finish, origin, write_figures
from wayfarer_lab.evaluation.tracks import Recorded

if TYPE_CHECKING:  # these load torch, which `wayfarer eval --help` must not
    from wayfarer_lab.evaluation.random_motion import Bench
    from wayfarer_lab.evaluation.rollout import FrozenPoses

app = typer.Typer()


class Starts(StrEnum):
    """Where start poses come from."""

    RECORDED = "recorded"
    PRIOR = "prior"


PosesOption = Annotated[int, typer.Option(help="Start poses, half of each gender.", min=2)]


@app.command(short_help="Random motion of every variant of the models (Fig. 3).")
def realism(
    models: options.Models = DEFAULT_MODEL,
    runs: options.Runs = None,
    poses: PosesOption = 100,
    seconds: Annotated[float, typer.Option(help="Seconds of each motion.", min=1.0)] = 10.0,
    only: options.Only = "",
    data: options.Data = None,
    split: options.Split = "heldout",
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    json: options.Json = None,
) -> None:
    """Measure the realism of random motion, for every variant of the models (Fig. 3).

    Latents come from N(0, I), or in the row `ro-policy` from the policy on the way to random
    goals; there is no search. With --data, start poses are frames of the split. Without it, they
    are the shipped ones, and the row "mocap", the Fréchet distance and `auc` are missing: how far
    a classifier tells the motion from that of recorded people (of the train split), which stands in
    for the paper's perceptual study. Rows "direct-…" are of --runs that hold predictors of body
    parameters (Sec. A.4).
    """
    from wayfarer_lab.evaluation.maneuvers.likeness import windows_of
    from wayfarer_lab.evaluation.metrics.frechet import FRAMES, Reference
    from wayfarer_lab.evaluation.random_motion import realism as make
    from wayfarer_lab.evaluation.realism import JudgedMotion, recorded_tracks

    recorded = Recorded(data, split) if data else None
    reference = mocap = people = None
    if data and recorded:
        train, mocap = Recorded(data, "train"), JudgedMotion.recorded(recorded)
        names = train.bodies["male"].marker_names
        long = recorded_tracks(train, FRAMES)
        reference = Reference.of((track.markers for track, _ in long), names)
        subjects = sorted({subject for _, subject in long})
        owners = [subjects.index(subject) for _, subject in long]
        people = windows_of([track.markers for track, _ in long], owners, names)
    with _bench(models, runs, threads, seed) as bench:
        tables = make(bench, _poses(recorded, poses, seed), seconds, mocap, reference, people, only)
    finish(json, tables, **origin(models, runs, data, split, seed), poses=poses, seconds=seconds)


@app.command(short_help="The least usual poses of random motion (Fig. S3).")
def failures(
    runs: Annotated[Path, typer.Option(help="Folder of runs direct_body…, direct_humor….")],
    models: options.Models = DEFAULT_MODEL,
    poses: PosesOption = 100,
    seconds: Annotated[float, typer.Option(help="Seconds of each motion.", min=1.0)] = 10.0,
    count: Annotated[int, typer.Option(help="Poses of each predictor.", min=1)] = 7,
    data: options.Data = None,
    split: options.Split = "heldout",
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    json: Annotated[Path, typer.Option(help="File to write.")] = Path("benchmarks/results")
    / "failures.json",
) -> None:
    """Find how random motion of direct representations fails (Fig. S3), beside that of markers.

    Of each motion the pose that the pose prior finds least usual, and of those the least usual:
    for each predictor of body parameters, and the 2-frame marker predictor. `wayfarer eval paper`
    draws them.
    """
    from wayfarer_lab.evaluation.direct import least_usual
    from wayfarer_lab.evaluation.model_parts import Variant

    report.check_origin()
    recorded = Recorded(data, split) if data else None
    with _bench(models, runs, threads, seed) as bench:
        if bench.pose_score is None:
            raise InvalidArgument(f"{models} holds no pose prior to judge poses by", "models")
        starts, frames = _poses(recorded, poses, seed), round(seconds * FPS)
        made = {name: bench.make_direct(name, starts, frames) for name in bench.parts.direct}
        made["markers, ro-2f"] = bench.make(Variant("ro-2f", "ro-2f"), starts, frames)
        found = {
            name: least_usual(list(zip(starts, own, strict=True)), bench.pose_score, count)
            for name, own in made.items()
        }
    write_figures(json, found, origin(models, runs, data, split, seed))


@app.command(short_help="Influence of body shape and start pose (Sec. A.2).")
def bodies(
    models: options.Models = DEFAULT_MODEL,
    runs: options.Runs = None,
    extent: Annotated[
        float, typer.Option(help="Outermost shapes, in standard deviations.", min=0.1, max=6.0)
    ] = 2.5,
    futures: Annotated[int, typer.Option(help="Motions per pose and gender.", min=1)] = 3,
    seconds: Annotated[float, typer.Option(help="Seconds of each motion.", min=1.0)] = 5.0,
    starts: Annotated[
        Starts,
        typer.Option(help="Ten start poses: frames of --data, or drawn from the pose prior."),
    ] = Starts.RECORDED,
    data: options.Data = None,
    split: options.Split = "heldout",
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    json: options.Json = None,
) -> None:
    """Compare ten body shapes from the same ten start poses, and each pose alone (Sec. A.2).

    Every row has the same noise. With a policy, rows also show how many bodies reach a goal 5 m
    ahead, and in how many primitives. The paper's own setting is --extent 6 --starts prior.
    """
    from wayfarer_lab.evaluation.random_motion import SHAPES
    from wayfarer_lab.evaluation.random_motion import bodies as make
    from wayfarer_lab.evaluation.realism import JudgedMotion
    from wayfarer_lab.evaluation.rollout import prior_poses

    recorded = Recorded(data, split) if data else None
    mocap = JudgedMotion.recorded(recorded) if recorded else None
    with _bench(models, runs, threads, seed) as bench:
        if starts is Starts.RECORDED:
            poses = _poses(recorded, 2 * SHAPES, seed)
        elif bench.parts.pose_prior is None:
            raise InvalidArgument(f"{models} holds no pose prior to draw poses from", "starts")
        else:
            random = np.random.default_rng(seed)
            poses = prior_poses(bench.parts.pose_prior, 2 * SHAPES, random)
        tables = make(bench, poses, extent, futures, seconds, mocap)
    finish(
        json, tables, **origin(models, runs, data, split, seed), extent=extent, futures=futures,
        seconds=seconds, starts=starts.value,
    )  # fmt: skip


@app.command(short_help="Foot skating of random motion (Sec. A.3).")
def skating(
    models: options.Models = DEFAULT_MODEL,
    runs: options.Runs = None,
    poses: PosesOption = 900,
    primitives: Annotated[int, typer.Option(help="Primitives of each motion.", min=5)] = 20,
    data: options.Data = None,
    split: options.Split = "heldout",
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    json: options.Json = None,
) -> None:
    """Measure foot skating of random motion, by MOJO's measure (Sec. A.3) and stricter ones."""
    from wayfarer_lab.evaluation.random_motion import skating as make
    from wayfarer_lab.evaluation.realism import JudgedMotion

    recorded = Recorded(data, split) if data else None
    mocap = JudgedMotion.recorded(recorded) if recorded else None
    with _bench(models, runs, threads, seed) as bench:
        tables = make(bench, _poses(recorded, poses, seed), primitives, mocap)
    finish(
        json, tables, **origin(models, runs, data, split, seed), poses=poses, primitives=primitives
    )


@app.command(short_help="The regressor beside reprojection by optimisation (MOJO, Sec. A.3).")
def reprojection(
    data: options.Recorded,
    models: options.Models = DEFAULT_MODEL,
    runs: options.Runs = None,
    poses: PosesOption = 100,
    primitives: Annotated[int, typer.Option(help="Primitives of each motion.", min=5)] = 20,
    count: options.Count = 100,
    iterations: Annotated[
        list[int], typer.Option(help="Iterations of a row of optimisation.", min=1)
    ] = [30, 100],  # noqa: B006
    split: options.Split = "heldout",
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    json: options.Json = None,
) -> None:
    """Find bodies behind markers by the regressor, and by optimisation as MOJO does.

    On recorded primitives: the error, and the processor time for a primitive of one body. In random
    motion of the 2-frame model: realism, as in `wayfarer eval realism`.
    """
    from wayfarer_lab.evaluation.models import primitives as windows
    from wayfarer_lab.evaluation.reprojection import reprojection as make

    recorded = Recorded(data, split)
    genders = sorted({clip.gender for clip in recorded.clips})
    known = {gender: windows(recorded, gender, count, seed).canonical() for gender in genders}
    with _bench(models, runs, threads, seed) as bench:
        tables = make(bench, _poses(recorded, poses, seed), primitives, known, iterations)
    finish(
        json, tables, **origin(models, runs, data, split, seed), poses=poses, primitives=primitives,
    )  # fmt: skip


def _poses(recorded: Recorded | None, count: int, seed: int) -> "list[FrozenPoses]":
    """Start poses from the split, or the shipped ones."""
    from wayfarer_lab.evaluation.rollout import recorded_poses, standing_poses

    random = np.random.default_rng(seed)
    return recorded_poses(recorded, count, random) if recorded else standing_poses(count, random)


@contextmanager
def _bench(models: Path, runs: Path | None, threads: int, seed: int) -> "Iterator[Bench]":
    """The settings that rows of a table share, and a progress line with the current row."""
    from wayfarer_lab.evaluation.model_parts import load_parts
    from wayfarer_lab.evaluation.random_motion import Bench

    parts = load_parts(models, runs, threads)
    with report.progress() as bar:
        task = bar.add_task("", total=None)

        def watch(name: str) -> None:
            bar.update(task, description=f"{name} (rows)", advance=1)

        yield Bench(parts, load_body(SHIPPED, "male", "low"), seed, watch)
