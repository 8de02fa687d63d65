"""`wayfarer eval long`: minutes of goal after goal, and adversarial goal commands."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from wayfarer.model_bundle import DEFAULT_MODEL, Bodies, open_bundle
from wayfarer.world.goals.steering import Steering
from wayfarer.world.world import World
from wayfarer_lab.evaluation.commands import options
from wayfarer_lab.evaluation.commands.shared import finish, origin, progress
from wayfarer_lab.evaluation.falls import FallWatch, draw_falls
from wayfarer_lab.evaluation.gait import MOCAP, Row, Windows, posed_gait_rows
from wayfarer_lab.evaluation.health import FAULTS, health_row
from wayfarer_lab.evaluation.maneuvers import robust
from wayfarer_lab.evaluation.maneuvers.case_runner import measured_takes
from wayfarer_lab.evaluation.maneuvers.maneuver import Case
from wayfarer_lab.evaluation.maneuvers.robust import MORE_SCRIPTS, SCRIPTS
from wayfarer_lab.evaluation.tasks import Watch, random_specs, run_tasks
from wayfarer_lab.evaluation.tracks import Recorded
from wayfarer_lab.evaluation.wander import wander
from wayfarer_lab.training.mocap.selection import Use

app = typer.Typer()

NAME = "goal after goal"
PLOTS = (*(f"{fault}_agents" for fault in FAULTS), "slide_cm_s", "contact_strict")


@app.command(short_help="Minutes of goal after goal: falling, sinking, floating, spinning.")
def long(
    models: options.Models = DEFAULT_MODEL,
    agents: Annotated[int, typer.Option(help="Number of agents.", min=1)] = 256,
    minutes: Annotated[float, typer.Option(help="Minutes of motion.", min=0.5)] = 10.0,
    scripted: Annotated[
        int, typer.Option(help="Agents per adversarial script; 0: no scripts.", min=0)
    ] = 32,
    data: options.Data = None,
    split: options.Split = "heldout",
    candidates: options.Candidates = 1,
    engine: options.Engine = "onnxruntime",
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    strips: Annotated[
        Path | None,
        typer.Option(help="Folder for film strips of the agents that got up.", file_okay=False),
    ] = None,
    json: options.Json = None,
) -> None:
    """Counts faults of bodies while agents walk from goal to goal for minutes.

    These agents get a new goal only when they stand. The adversarial scripts put goals behind
    walking agents, turn them round twice a second, and give a new goal every quarter of a second.
    An agent that leans or squats as nobody does gets up: each has a row with the moment and what
    the guard saw, and with --strips the seconds around it are drawn.
    """
    recorded = Recorded(data, split) if data else None
    bundle = open_bundle(models, threads, engine)
    steering, bodies = Steering().with_search(candidates=candidates), bundle.bodies
    world, random = bundle.world(agents, steering), np.random.default_rng(seed)
    specs = random_specs(agents, random)
    falls = [(NAME, _watched(world))]
    with progress(NAME) as watch:
        seen = wander(world, bodies, specs, minutes * 60, random, watch)
    row = health_row(NAME, seen.health, seen.resets)
    row["goals_given"], row["goals_reached"] = seen.goals_given, seen.goals_reached
    gait = posed_gait_rows(NAME, Windows.join(seen.gait), bodies["male"])
    if recorded:
        gait += posed_gait_rows(MOCAP, recorded.windows(Use.LOCOMOTION), bodies["male"])
    scripts = []
    for case in (*SCRIPTS, *MORE_SCRIPTS) if scripted else ():
        alone = bundle.world(scripted, steering)
        falls.append((case.name, _watched(alone)))
        with progress(case.name) as watch:
            scripts.append(_script(case, alone, scripted, random, bodies, watch))
    if strips:
        for name, found in falls:
            draw_falls(name, found.falls, bodies, strips)
    told = [fallen.row(name) for name, found in falls for fallen in found.falls]
    finish(
        json, {"Health": [row], "Scripts": scripts, "Gait": gait, "Resets": told}, PLOTS,
        **origin(models, None, data, split, seed),
        engine=engine, candidates=candidates, agents=agents, minutes=minutes, scripted=scripted,
    )  # fmt: skip


def _watched(world: World) -> FallWatch:
    falls = FallWatch()
    world.observe(falls)
    return falls


def _script(
    case: Case,
    world: World,
    agents: int,
    random: np.random.Generator,
    bodies: Bodies,
    watch: Watch,
) -> Row:
    """The row of one adversarial script."""
    trajectories = run_tasks(world, case.tasks(agents, random), case.seconds, watch=watch)
    shots = measured_takes(trajectories, bodies)
    figures = robust.robust_row(shots, [robust.measure_robust(shot) for shot in shots])
    return {"name": case.name, "agents": agents, "resets": world.scheduler.resets, **figures}
