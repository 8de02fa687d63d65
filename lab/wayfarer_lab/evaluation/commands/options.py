"""Options that several tables share."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from wayfarer.engines.engine import EngineKind
from wayfarer_lab.evaluation.report import check_origin


def check_json(path: Path | None) -> Path | None:
    """Fail before the evaluation, not minutes later: on a bad name, or a working tree whose commit
    is unknown.
    """
    if path is not None:
        if path.suffix != ".json":
            raise typer.BadParameter(f"{path} must end in .json")
        check_origin()
    return path


def among(known: Sequence[str]) -> Callable[[str], str]:
    """Refuses names, separated by commas, that are none of the known ones."""

    def check(names: str) -> str:
        if unknown := set(names.split(",")) - set(known):
            raise typer.BadParameter(f"{', '.join(sorted(unknown))}; there are {', '.join(known)}")
        return names

    return check


Policy10 = Annotated[
    Path | None, typer.Option(help="Model folder with the paper's policy: PPO, KL weight 10.")
]
Policy1 = Annotated[
    Path | None, typer.Option(help="Model folder with the paper's policy: PPO, KL weight 1.")
]
GoalCvae = Annotated[
    Path | None, typer.Option(help="Model folder of the baseline, the goal-conditioned CVAE.")
]
Models = Annotated[
    Path, typer.Option(help="Folder of a motion model.", show_default="the shipped model")
]
Runs = Annotated[
    Path | None,
    typer.Option(help="Folder of training runs; their networks replace those of the model."),
]
Data = Annotated[
    Path | None,
    typer.Option(
        help='Folder made by `wayfarer data prepare`. Without it, there is no row "mocap".'
    ),
]
Recorded = Annotated[Path, typer.Option(help="Folder made by `wayfarer data prepare`.")]
Split = Annotated[str, typer.Option(help="Split of the recordings: train, validation or heldout.")]
Json = Annotated[
    Path | None,
    typer.Option(
        "--json",
        help="File for the rows (.json); tables (.md) go beside it.",
        callback=check_json,
    ),
]
Seed = Annotated[int, typer.Option(help="The same seed gives the same rows.", min=0)]
Candidates = Annotated[int, typer.Option(help="Candidate primitives tried per step.", min=1)]
Engine = Annotated[
    EngineKind,
    typer.Option(help="Engine that steps the agents; auto: the faster one on this machine."),
]
Threads = Annotated[int, typer.Option(help="Threads of the engine; 0: all cores.", min=0)]
Count = Annotated[int, typer.Option(help="Recorded primitives per gender.", min=1)]
Only = Annotated[str, typer.Option(help="Rows to make, as ro-1f,ro-2f.", show_default="all")]
