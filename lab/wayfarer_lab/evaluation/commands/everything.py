"""`wayfarer eval all`."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer_lab.evaluation.commands import options
from wayfarer_lab.evaluation.commands.control import control
from wayfarer_lab.evaluation.commands.maneuvers import maneuvers
from wayfarer_lab.evaluation.commands.recorded import mocap, predictor, regressor
from wayfarer_lab.evaluation.commands.rollouts import bodies, realism, skating
from wayfarer_lab.evaluation.commands.scenes import scenes
from wayfarer_lab.evaluation.report import console

app = typer.Typer()

TABLES: Final[dict[str, Callable[..., None]]] = {
    "realism": realism,
    "skating": skating,
    "bodies": bodies,
    "predictor": predictor,
    "regressor": regressor,
    "control": control,
    "maneuvers": maneuvers,
    "scenes": scenes,
}
"""Tables in the order of their making: the long ones last."""

PARTS: Final = ("realism", "skating", "bodies", "predictor", "regressor")
"""Tables of networks that may come from training runs; the others measure the served graph."""

SERVED: Final = ("scenes",)
"""Tables without a row of recordings, since these have no scenes."""

EVERY_SPLIT: Final = ("maneuvers",)
"""Tables that show all splits of the recordings."""

QUICK: Final[dict[str, dict[str, Any]]] = {
    "realism": {"poses": 20},
    "skating": {"poses": 100},
    "bodies": {"futures": 1},
    "predictor": {"count": 200},
    "regressor": {"count": 50},
    "control": {"pairs": 10},
    "maneuvers": {"quick": True},
    "scenes": {"scale": 0.1, "minutes": 1.0},
}


@app.command("all", short_help="All tables at their default sizes.")
def everything(
    data: options.Recorded,
    models: options.Models = DEFAULT_MODEL,
    runs: options.Runs = None,
    out: Annotated[Path, typer.Option(help="Folder for the tables.")] = Path("runs/eval"),
    quick: Annotated[
        bool, typer.Option("--quick", help="A tenth of the size, for a trial.")
    ] = False,
    split: options.Split = "heldout",
    threads: options.Threads = 0,
    seed: options.Seed = 0,
) -> None:
    """Make all tables at their default sizes: NAME.json and NAME.md of each in a folder.

    Each table is written when it is finished, so Ctrl-C keeps the finished ones.
    """
    mocap(data, json=out / "mocap.json")
    for name, table in TABLES.items():
        console.rule(name)
        table(
            models=models, threads=threads, seed=seed, json=out / f"{name}.json",
            **({} if name in SERVED else {"data": data}),
            **({} if name in (*SERVED, *EVERY_SPLIT) else {"split": split}),
            **({"runs": runs} if name in PARTS else {}),
            **(QUICK[name] if quick else {}),
        )  # fmt: skip
