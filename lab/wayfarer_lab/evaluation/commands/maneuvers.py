"""`wayfarer eval maneuvers`: does everything look as a person would do it?"""

from pathlib import Path
from time import process_time
from typing import Annotated, Final

import typer

from wayfarer.models.bundle import DEFAULT_MODEL, open_bundle
from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.commands import options
from wayfarer_lab.evaluation.commands.shared import origin, progress
from wayfarer_lab.evaluation.maneuvers.case_runner import CaseRunner
from wayfarer_lab.evaluation.maneuvers.crowd import CROWD
from wayfarer_lab.evaluation.maneuvers.likeness import LIKENESS
from wayfarer_lab.evaluation.maneuvers.maneuver import Maneuver
from wayfarer_lab.evaluation.maneuvers.path import PATH
from wayfarer_lab.evaluation.maneuvers.recorded import RecordedClips
from wayfarer_lab.evaluation.maneuvers.robust import RANDOM, REVERSALS
from wayfarer_lab.evaluation.maneuvers.run import no_recordings, play
from wayfarer_lab.evaluation.maneuvers.stairs import STAIRS
from wayfarer_lab.evaluation.maneuvers.stand import STAND
from wayfarer_lab.evaluation.maneuvers.stop import STOP
from wayfarer_lab.evaluation.maneuvers.strafe import STRAFE
from wayfarer_lab.evaluation.maneuvers.strips import draw
from wayfarer_lab.evaluation.maneuvers.table import Results, show, show_verdicts
from wayfarer_lab.evaluation.maneuvers.turn import TURN
from wayfarer_lab.evaluation.maneuvers.walk import WALK
from wayfarer_lab.evaluation.twosided.compare import MANEUVER, compare
from wayfarer_lab.evaluation.twosided.compare import show as show_sides
from wayfarer_lab.evaluation.twosided.ranges import load as load_ranges
from wayfarer_lab.evaluation.twosided.served import PEOPLE

app = typer.Typer()

MANEUVERS: Final[dict[str, Maneuver]] = {
    maneuver.name: maneuver
    for maneuver in (
        STRAFE, STAND, TURN, STOP, PATH, REVERSALS, STAIRS, CROWD, WALK, LIKENESS, RANDOM
    )
}  # fmt: skip

QUICK: Final = 0.15
"""Share of the agents with --quick."""

PARTS: Final = (MANEUVER, *MANEUVERS)
"""What `--only` chooses from."""


@app.command(short_help="Every manoeuvre, beside recorded people and with bars to meet.")
def maneuvers(
    models: options.Models = DEFAULT_MODEL,
    only: Annotated[
        str, typer.Option(help="Manoeuvres, separated by commas.", callback=options.among(PARTS))
    ] = ",".join(PARTS),
    quick: Annotated[
        bool, typer.Option("--quick", help="A seventh of the agents, for a trial.")
    ] = False,
    seeds: Annotated[
        int, typer.Option(help="Seeds of the two-sided figures, from --seed on.", min=1)
    ] = 8,
    check: Annotated[
        bool, typer.Option("--check", help="Exit with 1 if any bar is missed or not judged.")
    ] = False,
    data: options.Data = None,
    candidates: options.Candidates = 1,
    engine: options.Engine = "onnxruntime",
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    strips: Annotated[
        Path | None,
        typer.Option(
            help="Folder for film strips of the worst and the median take of each case (minutes).",
            file_okay=False,
        ),
    ] = None,
    json: Annotated[
        Path | None,
        typer.Option(
            "--json",
            help="File for rows, bars and the figures of every take; written as they come.",
            callback=options.check_json,
        ),
    ] = None,
) -> None:
    """Measures the poses of agents that perform every manoeuvre that goals can ask for.

    The two-sided figures come first: medians of people as sent and of the model alone ("raw": no
    rule after it) beside the range of recorded people, whether each holds, and how far rules move
    joints. Then each manoeuvre: as sent, raw, and with --data recorded people; each bar, and
    whether it is met. A table of all bars ends the output. For example:

    wayfarer eval maneuvers --quick

    wayfarer eval maneuvers --only strafe,turn --models runs/models --seed 7 --json runs/m.json

    wayfarer eval maneuvers --data data/prepared --engine openvino --check

    `wayfarer eval define` explains the figures. Agents have random shapes of both genders. A seed
    gives a manoeuvre the same agents whatever --only selects.
    """
    runner = CaseRunner(open_bundle(models, threads, engine), candidates, seed)
    results = Results(
        report.meta(
            origin(models, None, data, "", seed)
            | {"engine": engine, "candidates": candidates, "quick": quick}
        )
    )
    names = only.split(",")
    if MANEUVER in names:
        people = max(2, round(PEOPLE * (QUICK if quick else 1.0)))
        sides = compare(runner, load_ranges(), people, seeds, progress)
        show_sides(sides)
        results.two_sided = [side.row() for side in sides]
        if json:
            results.write(json)
    recorded = RecordedClips(data) if data else no_recordings
    chosen = [MANEUVERS[name] for name in names if name != MANEUVER]
    for played in play(runner, chosen, QUICK if quick else 1.0, progress, recorded):
        before = len(results.verdicts)
        results.add(played.maneuver, played.rows, played.each)
        results.meta["cpu_seconds"] = round(process_time())
        show(played.maneuver, played.rows, results.verdicts[before:])
        if json:
            results.write(json)
        if strips:
            strips.mkdir(parents=True, exist_ok=True)
            draw(played, strips)
    if chosen:
        show_verdicts(results.verdicts)
    if check and results.missed:
        raise typer.Exit(1)
