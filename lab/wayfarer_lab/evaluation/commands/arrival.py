"""`wayfarer eval arrival`: how well agents do what goals ask of them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from wayfarer.model_bundle import DEFAULT_MODEL, Bodies, open_world
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.world import World
from wayfarer_lab.evaluation.commands import options
from wayfarer_lab.evaluation.commands.shared import finish, origin, progress
from wayfarer_lab.evaluation.gait import MOCAP, Row, Windows, posed_gait_rows, stillness_row
from wayfarer_lab.evaluation.outcome import STEP_LIMIT, goal_outcome, goal_row
from wayfarer_lab.evaluation.scenarios import Scenario
from wayfarer_lab.evaluation.seeds import walking_seeds
from wayfarer_lab.evaluation.tasks import Trajectory, run_tasks
from wayfarer_lab.evaluation.tracks import Recorded
from wayfarer_lab.training.mocap.selection import Use

app = typer.Typer()

PLOTS = (
    "arrival_error_median_m", "drift_2s_mean_m", "facing_error_median_deg", "slide_cm_s",
    "marker_speed_cm_s",
)  # fmt: skip

STANDING = "from standing"
UNLOCKED = "from standing, no foot lock"
WALKING = "from walking"


@app.command(short_help="Walk to goals, stop and stand.")
def arrival(
    models: options.Models = DEFAULT_MODEL,
    goals: Annotated[int, typer.Option(help="Goals 3 to 8 m away, per table row.", min=1)] = 100,
    data: options.Data = None,
    split: options.Split = "heldout",
    candidates: options.Candidates = 1,
    engine: options.Engine = "onnxruntime",
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    json: options.Json = None,
) -> None:
    """Measure how agents walk to goals 3 to 8 m away, stop and stand.

    With --data, runs "from walking" begin in recorded walking of the split, and the recordings
    have rows of their own. Without it, they begin after 2 s of walking.
    """
    recorded = Recorded(data, split) if data else None
    world, bodies = open_world(models, goals, candidates, threads, engine)
    random = np.random.default_rng(seed)
    tables = _arrivals(world, bodies, goals, random, recorded)
    if data and recorded:
        locomotion = recorded.windows(Use.LOCOMOTION)
        tables["On the way"] += posed_gait_rows(MOCAP, locomotion, bodies["male"])
        tables["Standing"] += _recorded_stillness(data, recorded)
    finish(
        json, tables, PLOTS, **origin(models, None, data, split, seed),
        engine=engine, candidates=candidates, goals=goals,
    )  # fmt: skip


def _arrivals(
    world: World,
    bodies: Bodies,
    goals: int,
    random: np.random.Generator,
    recorded: Recorded | None,
) -> dict[str, list[Row]]:
    """Tables of arrival, of the gait on the way and of standing after it."""
    tables: dict[str, list[Row]] = {"Goals": [], "On the way": [], "Standing": []}
    for scenario in (
        Scenario(STANDING),
        Scenario(WALKING, walking=recorded is None),
        Scenario("facing asked", facing=True),
    ):
        tasks, seeds = scenario.tasks(goals, random), None
        if recorded and scenario.name == WALKING:
            seeds = walking_seeds(recorded, [task.spec for task in tasks], random)
        with progress(scenario.name) as watch:
            trajectories = run_tasks(world, tasks, scenario.seconds, seeds=seeds, watch=watch)
        outcomes = [goal_outcome(trajectory) for trajectory in trajectories]
        tables["Goals"].append(goal_row(scenario.name, outcomes))
        tables["On the way"] += _gait(scenario.name, trajectories, bodies)
        tables["Standing"] += _stillness(scenario.name, trajectories, bodies)
        if scenario.name == STANDING:  # the lock moves legs only: goals and stops are the same
            raw = [replace(e, spec=replace(e.spec, foot_lock=False)) for e in tasks]
            with progress(UNLOCKED) as watch:
                trajectories = run_tasks(world, raw, STEP_LIMIT * STEP_SECONDS, watch=watch)
            tables["On the way"] += _gait(UNLOCKED, trajectories, bodies)
    return tables


def _gait(name: str, trajectories: Sequence[Trajectory], bodies: Bodies) -> list[Row]:
    """Gait on the way to the goal."""
    parts = [
        trajectory.latest()
        .track(bodies[trajectory.spec.gender], goal_outcome(trajectory).walking())
        .windows()
        for trajectory in trajectories
    ]
    return posed_gait_rows(name, Windows.join(parts), bodies["male"])


def _stillness(name: str, trajectories: Sequence[Trajectory], bodies: Bodies) -> list[Row]:
    """Stillness of the agents that came to a stand; no row if none did."""
    parts = [
        trajectory.latest().track(bodies[trajectory.spec.gender], frames).windows()
        for trajectory in trajectories
        if (frames := goal_outcome(trajectory).standing())
    ]
    return [stillness_row(f"{name}, standing", Windows.join(parts))] if parts else []


def _recorded_stillness(data: Path, recorded: Recorded) -> list[Row]:
    """Stillness of recorded people. Long stands are scarce: where the split has none, those of all
    splits take their place.
    """
    name, motion = MOCAP, recorded.windows(Use.STANDING)
    if not len(motion.markers):
        name = f"{MOCAP} of all splits"
        splits = {clip.split for clip in recorded.data.clips if clip.augmentation == ""}
        motion = Windows.join([Recorded(data, s).windows(Use.STANDING) for s in sorted(splits)])
    return [stillness_row(f"{name}, standing", motion)]
