"""`wayfarer eval scenes`: how agents walk in scenes and among each other."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Final

import typer

from wayfarer.models.bundle import DEFAULT_MODEL, open_bundle
from wayfarer_lab.evaluation.commands import options
from wayfarer_lab.evaluation.commands.shared import finish, origin, progress
from wayfarer_lab.evaluation.scenes.pictures import Focus, plan, save, view
from wayfarer_lab.evaluation.scenes.scenarios.changes import crates, doors
from wayfarer_lab.evaluation.scenes.scenarios.outcome import Outcome
from wayfarer_lab.evaluation.scenes.scenarios.walking import (
    corridor,
    cubes,
    doorway,
    slope,
    square,
    storeys,
)
from wayfarer_lab.evaluation.scenes.scene_run import SceneRig
from wayfarer_lab.evaluation.tasks import Watch

app = typer.Typer()

Scenario = Callable[[SceneRig, int, int, Watch], Outcome]
"""(rig, seed, how many people, watch)"""

SCENARIOS: Final[Mapping[str, tuple[Scenario, int]]] = {
    "cubes": (cubes, 100),
    "corridor": (corridor, 20),
    "doorway": (doorway, 8),
    "slope": (slope, 8),
    "storeys": (storeys, 8),
    "doors": (doors, 8),
    "crates": (crates, 16),
}
"""Scenario and number of people; in corridor and doorway, at either end."""

SQUARE, PEOPLE = "square", 200
ALL: Final = (*SCENARIOS, SQUARE)
CAMERAS: Final = {
    "cubes": Focus((10.0, 9.0), 13.0),
    "corridor": Focus((12.0, 0.0), 7.5, elevation=60.0),
    "doorway": Focus((0.0, 0.0), 6.0, elevation=60.0),
    "slope": Focus((10.0, 11.0), 9.0),
    "storeys": Focus((4.5, 3.0), 7.5),
    "doors": Focus((12.0, 0.0), 12.0, elevation=60.0),
    "crates": Focus((10.0, 9.0), 13.0),
    SQUARE: Focus((0.0, -3.0), 19.0),
}
"""Cameras of the pictures, by scenario."""


@app.command(short_help="Example scenes: walls, other people, slopes, doors that shut.")
def scenes(
    models: options.Models = DEFAULT_MODEL,
    only: Annotated[
        str, typer.Option(help="Scenarios, separated by commas.", callback=options.among(ALL))
    ] = ",".join(ALL),
    scale: Annotated[
        float, typer.Option(help="Factor on the number of people.", min=0.01, max=4)
    ] = 1.0,
    minutes: Annotated[
        float, typer.Option(help="Minutes of the scenario square.", min=0.05)
    ] = 10.0,
    pictures: Annotated[
        Path | None,
        typer.Option(help="Folder for pictures of each scene: all trails from above, and a view."),
    ] = None,
    candidates: options.Candidates = 1,
    engine: options.Engine = "onnxruntime",
    threads: options.Threads = 1,
    seed: options.Seed = 0,
    repeats: Annotated[
        int, typer.Option(help="Runs of each scenario, with seeds from --seed on.", min=1)
    ] = 1,
    json: options.Json = None,
) -> None:
    """Measures what people touch on their way through example scenes."""
    rig = SceneRig(open_bundle(models, threads, engine), candidates)
    tried: dict[str, tuple[Scenario, int]] = {
        **SCENARIOS,
        SQUARE: (partial(square, 60 * minutes), PEOPLE),
    }
    rows, worst = [], {}
    runs = [(name, seed + k) for name in only.split(",") for k in range(repeats)]
    for name, number in runs:
        scenario, usual = tried[name]
        called = name if repeats == 1 else f"{name}, seed {number}"
        with progress(called) as watch:
            seen = scenario(rig, number, max(1, round(scale * usual)), watch)
        rows.append(seen.row | {"name": called})
        worst[called] = seen.monitor.worst()
        if pictures:
            save(pictures / f"{called}.png", plan(seen.scene, seen.monitor.trails()))
            drawn = view(seen.scene, seen.monitor, CAMERAS[name])
            save(pictures / f"{called}_view.png", drawn)
    finish(
        json, {"Scenes": rows}, **origin(models, None, None, "", seed), engine=engine,
        candidates=candidates, scale=scale, minutes=minutes, repeats=repeats, worst=worst,
    )  # fmt: skip
