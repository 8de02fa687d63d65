"""`wayfarer eval …`: tables on the screen, and with --json the rows in a file with their origin."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from wayfarer.evaluation import report
from wayfarer.evaluation.gait import Row, Windows, gait_row, stillness_row
from wayfarer.evaluation.goals import Run, Watch, random_specs, run_goals
from wayfarer.evaluation.health import health_row
from wayfarer.evaluation.outcome import goal_row
from wayfarer.evaluation.tracks import Recorded
from wayfarer.evaluation.wander import wander
from wayfarer.stage import DEFAULT_MODEL, Bodies, open_world
from wayfarer.training.mocap.selection import Use
from wayfarer.training.mocap.store import Dataset

app = typer.Typer(help="Measure motion and models.", no_args_is_help=True)


def _check_json(path: Path | None) -> Path | None:
    """Refuse a bad name before an evaluation of minutes, not after it."""
    if path is not None and path.suffix != ".json":
        raise typer.BadParameter(f"{path} must end in .json")
    return path


ModelsOption = Annotated[Path, typer.Option(help="Folder of a motion model.")]
DataOption = Annotated[Path | None, typer.Option(help="Folder of `wayfarer data prepare`.")]
SplitOption = Annotated[str, typer.Option(help="train, validation or heldout.")]
JsonOption = Annotated[
    Path | None, typer.Option("--json", help="Also write the rows here.", callback=_check_json)
]
SeedOption = Annotated[int, typer.Option(help="The same seed gives the same rows.", min=0)]
CandidatesOption = Annotated[int, typer.Option(help="Candidates of the search.", min=1)]
ThreadsOption = Annotated[int, typer.Option(help="Threads of the engine; 0: all cores.", min=0)]
CountOption = Annotated[int, typer.Option(help="Recorded primitives per gender.", min=1)]


@app.command()
def goals(
    models: ModelsOption = DEFAULT_MODEL,
    runs: Annotated[int, typer.Option(help="Runs of each kind.", min=1)] = 100,
    data: DataOption = None,
    split: SplitOption = "heldout",
    candidates: CandidatesOption = 8,
    threads: ThreadsOption = 0,
    seed: SeedOption = 0,
    json: JsonOption = None,
) -> None:
    """Send agents to goals 3 to 8 m away, from standing and from walking, and watch them stop.

    With --data, walking runs begin in recorded walking of the split, and its own figures are
    given beside those of the agents; without, they begin after 2 s of walking.
    """
    recorded = Recorded(data, split) if data else None
    world, bodies = open_world(models, runs, candidates, threads)
    random = np.random.default_rng(seed)
    done: dict[str, list[Run]] = {}
    specs = random_specs(runs, random)
    with _progress("from standing") as watch:
        done["from standing"] = run_goals(world, bodies, specs, random, watch=watch)
    specs = random_specs(runs, random)
    with _progress("from walking") as watch:
        if recorded:
            from wayfarer.evaluation.seeds import walking_seeds

            seeds = walking_seeds(recorded, specs, random)
            done["from walking"] = run_goals(world, bodies, specs, random, seeds=seeds, watch=watch)
        else:
            done["from walking"] = run_goals(
                world, bodies, specs, random, walking=True, watch=watch
            )

    reach = [goal_row(name, [run.outcome for run in runs]) for name, runs in done.items()]
    gait, still = [], []
    for name, made in done.items():
        motion = Windows.join([r.track[r.outcome.walking()].windows() for r in made])
        gait += _gait(name, motion, bodies)
        stands = [(r, r.outcome.standing()) for r in made]
        standing = [r.track[frames].windows() for r, frames in stands if frames is not None]
        if standing:
            still.append(stillness_row(f"{name}, standing", Windows.join(standing)))
    if recorded:
        gait += _recorded_gait(recorded, split)
        still += _recorded_stillness(recorded, split)
    _finish(
        json,
        {"Goals": reach, "On the way": gait, "Standing": still},
        seed=seed, models=str(models), split=split if data else None, candidates=candidates,
    )  # fmt: skip


@app.command()
def long(
    models: ModelsOption = DEFAULT_MODEL,
    agents: Annotated[int, typer.Option(help="Agents.", min=1)] = 64,
    minutes: Annotated[float, typer.Option(help="Minutes of motion.", min=0.5)] = 10.0,
    candidates: CandidatesOption = 8,
    threads: ThreadsOption = 0,
    seed: SeedOption = 0,
    json: JsonOption = None,
) -> None:
    """Let agents go from goal to goal for minutes, and count what goes wrong with their bodies."""
    world, bodies = open_world(models, agents, candidates, threads)
    random = np.random.default_rng(seed)
    specs = random_specs(agents, random)
    with _progress("goal after goal") as watch:
        seen = wander(world, bodies, specs, minutes * 60, random, watch)
    row = health_row("goal after goal", seen.health, seen.resets)
    row["goals_given"], row["goals_reached"] = seen.goals_given, seen.goals_reached
    gait = _gait("goal after goal", Windows.join(seen.gait), bodies)
    _finish(
        json, {"Health": [row], "Gait": gait},
        seed=seed, models=str(models), candidates=candidates,
    )  # fmt: skip


@app.command()
def mocap(
    data: Annotated[Path, typer.Argument(help="Folder of `wayfarer data prepare`.")],
    json: JsonOption = None,
) -> None:
    """Judge the recordings themselves, by the same code, one row for each split."""
    gait: list[Row] = []
    still: list[Row] = []
    for split in sorted({clip.split for clip in Dataset.load(data).clips}):
        recorded = Recorded(data, split)
        gait += _recorded_gait(recorded, split)
        still += _recorded_stillness(recorded, split)
    _finish(json, {"Recorded locomotion": gait, "Recorded standing": still}, data=str(data))


@app.command()
def predictor(
    data: Annotated[Path, typer.Argument(help="Folder of `wayfarer data prepare`.")],
    models: ModelsOption = DEFAULT_MODEL,
    split: SplitOption = "heldout",
    samples: Annotated[int, typer.Option(help="Futures per seed.", min=2)] = 10,
    count: CountOption = 1000,
    seed: SeedOption = 0,
    json: JsonOption = None,
) -> None:
    """Errors and diversity of the predictors, beside the two simplest guesses."""
    from wayfarer.evaluation.models import ALIKE_SEEDS, predictor_rows

    rows = predictor_rows(models, Recorded(data, split), samples, count, seed)
    about = {"seed": seed, "models": str(models), "split": split, "alike_seeds_m": ALIKE_SEEDS}
    _finish(json, {"Predictors": rows}, **about)


@app.command()
def regressor(
    data: Annotated[Path, typer.Argument(help="Folder of `wayfarer data prepare`.")],
    models: ModelsOption = DEFAULT_MODEL,
    split: SplitOption = "heldout",
    count: CountOption = 300,
    seed: SeedOption = 0,
    json: JsonOption = None,
) -> None:
    """Errors of the body regressors, with the recorded shapes and with random ones."""
    from wayfarer.evaluation.models import regressor_rows

    rows = regressor_rows(models, Recorded(data, split), count, seed)
    _finish(json, {"Regressors": rows}, seed=seed, models=str(models), split=split)


@app.command("all")
def everything(
    data: Annotated[Path, typer.Option(help="Folder of `wayfarer data prepare`.")],
    models: ModelsOption = DEFAULT_MODEL,
    out: Annotated[Path, typer.Option(help="Folder for the JSON files.")] = Path("runs/eval"),
    split: SplitOption = "heldout",
    threads: ThreadsOption = 0,
    seed: SeedOption = 0,
) -> None:
    """All tables at their default sizes, one JSON file each; the long run is the long part."""
    mocap(data, json=out / "mocap.json")
    predictor(data, models, split, seed=seed, json=out / "predictor.json")
    regressor(data, models, split, seed=seed, json=out / "regressor.json")
    goals(models, data=data, split=split, threads=threads, seed=seed, json=out / "goals.json")
    long(models, threads=threads, seed=seed, json=out / "long.json")


def _gait(name: str, motion: Windows, bodies: Bodies) -> list[Row]:
    """Rows of all windows and of those at walking speed. Both genders have the same markers."""
    soles = next(iter(bodies.values())).sole_markers
    return [
        gait_row(name, motion, soles),
        gait_row(f"{name}, 0.9-1.4 m/s", motion.at_walking_speed(), soles),
    ]


def _recorded_gait(recorded: Recorded, split: str) -> list[Row]:
    return _gait(f"mocap {split}", recorded.windows(Use.LOCOMOTION), recorded.bodies)


def _recorded_stillness(recorded: Recorded, split: str) -> list[Row]:
    return [stillness_row(f"mocap {split}, standing", recorded.windows(Use.STANDING))]


@contextmanager
def _progress(title: str) -> Iterator[Watch]:
    """A bar over seconds of motion."""
    with report.progress() as bar:
        task = bar.add_task(f"{title} (seconds of motion)", total=None)
        yield lambda done, total: bar.update(task, completed=int(done), total=int(total))


def _finish(json: Path | None, tables: dict[str, list[Row]], **about: Any) -> None:
    for title, rows in tables.items():
        report.show(title, rows)
    if json is not None:
        report.write(json, [row for rows in tables.values() for row in rows], **about)
