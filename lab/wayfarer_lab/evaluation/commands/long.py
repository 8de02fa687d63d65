"""`wayfarer eval long`: minutes of goal after goal."""

from typing import Annotated

import numpy as np
import typer

from wayfarer.stage import DEFAULT_MODEL, open_world
from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.commands.options import (
    CandidatesOption,
    DataOption,
    EngineOption,
    JsonOption,
    ModelsOption,
    SeedOption,
    SplitOption,
    ThreadsOption,
)
from wayfarer_lab.evaluation.commands.shared import finish, origin, progress
from wayfarer_lab.evaluation.gait import Windows
from wayfarer_lab.evaluation.goals import random_specs
from wayfarer_lab.evaluation.health import FAULTS, health_row
from wayfarer_lab.evaluation.posture import posed_gait_rows
from wayfarer_lab.evaluation.tracks import Recorded
from wayfarer_lab.evaluation.wander import wander
from wayfarer_lab.training.mocap.selection import Use

app = typer.Typer()

NAME = "goal after goal"
PLOTS = (*(f"{fault}_agents" for fault in FAULTS), "slide_cm_s", "contact_strict")


@app.command()
def long(
    models: ModelsOption = DEFAULT_MODEL,
    agents: Annotated[int, typer.Option(help="Agents.", min=1)] = 256,
    minutes: Annotated[float, typer.Option(help="Minutes of motion.", min=0.5)] = 10.0,
    data: DataOption = None,
    split: SplitOption = "heldout",
    candidates: CandidatesOption = 4,
    engine: EngineOption = "onnxruntime",
    threads: ThreadsOption = 0,
    seed: SeedOption = 0,
    json: JsonOption = None,
) -> None:
    """Let agents go from goal to goal for minutes, and count what goes wrong with their bodies."""
    recorded = Recorded(data, split) if data else None
    world, bodies = open_world(models, agents, candidates, threads, engine)
    random = np.random.default_rng(seed)
    specs = random_specs(agents, random)
    with progress(NAME) as watch:
        seen = wander(world, bodies, specs, minutes * 60, random, watch)
    row = health_row(NAME, seen.health, seen.resets)
    row["goals_given"], row["goals_reached"] = seen.goals_given, seen.goals_reached
    gait = posed_gait_rows(NAME, Windows.join(seen.gait), bodies["male"])
    if recorded:
        gait += posed_gait_rows(report.MOCAP, recorded.windows(Use.LOCOMOTION), bodies["male"])
    finish(
        json, {"Health": [row], "Gait": gait}, PLOTS, **origin(models, None, data, split, seed),
        engine=engine, candidates=candidates, agents=agents, minutes=minutes,
    )  # fmt: skip
