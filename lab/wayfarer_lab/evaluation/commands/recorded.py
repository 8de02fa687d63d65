"""Tables of recorded motion: the recordings themselves, predictors and regressors on them."""

from dataclasses import replace
from typing import Annotated

import typer

from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer_lab.evaluation.commands import options
from wayfarer_lab.evaluation.commands.shared import finish, origin
from wayfarer_lab.evaluation.gait import MOCAP, Row, gait_row
from wayfarer_lab.evaluation.tracks import Recorded
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.store import Dataset

app = typer.Typer()


@app.command(short_help="The recordings themselves, one row per split.")
def mocap(data: options.Recorded, json: options.Json = None) -> None:
    """Measure the recordings with the code that measures the models: one row per split."""
    gait: list[Row] = []
    for split in sorted({clip.split for clip in Dataset.load(data).clips}):
        recorded = Recorded(data, split)
        soles, motion = recorded.bodies["male"].sole_markers, recorded.windows(Use.LOCOMOTION)
        gait += [
            gait_row(f"{MOCAP} {split}", motion, soles),
            gait_row(f"{MOCAP} {split}, 0.9-1.4 m/s", motion.at_walking_speed(), soles),
        ]
    finish(json, {"Recorded locomotion": gait}, data=str(data))


@app.command(short_help="Errors and diversity of the marker predictors (Tab. S1).")
def predictor(
    data: options.Recorded,
    models: options.Models = DEFAULT_MODEL,
    runs: options.Runs = None,
    split: options.Split = "heldout",
    samples: Annotated[int, typer.Option(help="Futures per seed.", min=2)] = 10,
    only: options.Only = "",
    count: options.Count = 1000,
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    json: options.Json = None,
) -> None:
    """Measure errors and diversity of the marker predictors (Tab. S1), beside simple baselines.

    The row "mocap" predicts the recorded futures of the primitives of the train split with the
    nearest seeds.
    """
    from wayfarer_lab.evaluation.model_parts import load_parts, some
    from wayfarer_lab.evaluation.models import ALIKE_SEEDS, predictor_rows

    recorded, memory = Recorded(data, split), Recorded(data, "train")
    parts = load_parts(models, runs, threads)
    chosen = some(parts.predictors, only)
    rows = predictor_rows(replace(parts, predictors=chosen), recorded, samples, count, seed, memory)
    finish(
        json, {"Predictors": rows}, **origin(models, runs, data, split, seed),
        alike_seeds_m=ALIKE_SEEDS,
    )  # fmt: skip


@app.command(short_help="Errors of the body regressors (Tab. S2).")
def regressor(
    data: options.Recorded,
    models: options.Models = DEFAULT_MODEL,
    runs: options.Runs = None,
    split: options.Split = "heldout",
    count: options.Count = 300,
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    json: options.Json = None,
) -> None:
    """Measure errors of the body regressors (Tab. S2), with recorded and with random shapes."""
    from wayfarer_lab.evaluation.model_parts import load_parts
    from wayfarer_lab.evaluation.models import regressor_rows

    recorded = Recorded(data, split)
    rows = regressor_rows(load_parts(models, runs, threads), recorded, count, seed)
    finish(json, {"Regressors": rows}, **origin(models, runs, data, split, seed))
