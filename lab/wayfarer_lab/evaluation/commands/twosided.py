"""Two-sided figures: ranges of recorded people, compared with the bare model."""

from pathlib import Path
from typing import Annotated

import typer

from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.commands import options
from wayfarer_lab.evaluation.commands.shared import origin
from wayfarer_lab.evaluation.maneuvers.recorded import RecordedClips
from wayfarer_lab.evaluation.twosided import ranges as recorded
from wayfarer_lab.evaluation.twosided import verdicts

app = typer.Typer()

JsonOption = Annotated[
    Path | None, typer.Option("--json", help="File for verdicts and every person's figures.")
]


@app.command(short_help="Ranges of recorded people, for the two-sided figures.")
def ranges(
    data: options.Recorded,
    out: Annotated[Path, typer.Option(help="File to write.")] = recorded.FILE,
) -> None:
    """Find in recordings what people are asked to do, measure it, and write the ranges.

    From the 10th to the 90th percentile of the train split, each performer counting once. The file
    is part of the lab, so that no other evaluation needs recordings for it.
    """
    clips = RecordedClips(data, legs=True)
    with report.console.status("clips") as status:
        found = recorded.measure(clips, each=status.update)
    people = sorted({stretch.performer for stretch in found})
    made = recorded.ranges_of(found)
    meta = {"split": recorded.SPLIT, "stretches": len(found), "performers": people}
    recorded.save(made, meta | {"made": report.meta({})}, out)
    recorded.show(made)


@app.command(short_help="The model alone against the ranges, without any rule after it.")
def bare(
    models: options.Models = DEFAULT_MODEL,
    runs: options.Runs = None,
    predictor: Annotated[str, typer.Option(help="2f or ro-2f.")] = "ro-2f",
    policy: Annotated[
        Path | None, typer.Option(help="Run folder of a trajectory policy that drives it.")
    ] = None,
    candidates: Annotated[
        int, typer.Option(help="Draws of the search, without a policy.", min=1)
    ] = 64,
    people: Annotated[int, typer.Option(help="People of each order.", min=2)] = 8,
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    json: JsonOption = None,
) -> None:
    """Drive a predictor for 12 s of each order, and judge its people.

    By one draw a step of a policy that was cloned or taught to follow trajectories; without one, by
    the best of some draws from N(0, I).

    Every figure holds when the median of people lies in the recorded range, and people differ by
    at least 30 % as much as recorded ones.
    """
    import torch

    from wayfarer_lab.evaluation.model_parts import Variant, load_parts
    from wayfarer_lab.evaluation.twosided.bare import play
    from wayfarer_lab.evaluation.twosided.drivers import led, searched
    from wayfarer_lab.training.cloning import load_trajectory_policy

    parts = load_parts(models, runs, threads)
    variant = Variant("bare", predictor)
    bodies = {gender: parts.step(gender, variant) for gender in parts.regressors}
    steps = {}
    leads = load_trajectory_policy(policy).eval() if policy else None
    for gender, step in bodies.items():
        random = torch.Generator().manual_seed(seed)
        steps[gender] = led(step, leads, random) if leads else searched(step, random, candidates)
    found = play(steps, people, seed)
    judged = verdicts.verdicts_of(found, recorded.load())
    verdicts.show("the model alone", judged)
    if json:
        driver = {"policy": str(policy)} if policy else {"candidates": candidates}
        verdicts.write(json, judged, found, origin(models, runs, None, "", seed) | driver)
