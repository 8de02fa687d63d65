"""Options that several tables share."""

import importlib
from pathlib import Path
from typing import Annotated

import typer

from wayfarer.engines.engine import EngineKind
from wayfarer_lab.evaluation.report import check_origin


def _check_json(path: Path | None) -> Path | None:
    """Fail before the evaluation, not minutes later: on a bad name, a missing plot library, or a
    working tree whose commit is unknown.
    """
    if path is not None:
        if path.suffix != ".json":
            raise typer.BadParameter(f"{path} must end in .json")
        check_origin()
        importlib.import_module("matplotlib")
    return path


Policy10Option = Annotated[
    Path | None, typer.Option(help="Model folder with the paper's policy: PPO, KL weight 10.")
]
Policy1Option = Annotated[
    Path | None, typer.Option(help="Model folder with the paper's policy: PPO, KL weight 1.")
]
GoalCvaeOption = Annotated[
    Path | None, typer.Option(help="Model folder of the baseline, the goal-conditioned CVAE.")
]
ModelsOption = Annotated[
    Path, typer.Option(help="Folder of a motion model.", show_default="the shipped model")
]
RunsOption = Annotated[
    Path | None,
    typer.Option(help="Folder of training runs; their networks replace those of the model."),
]
DataOption = Annotated[
    Path | None,
    typer.Option(
        help='Folder made by `wayfarer data prepare`. Without it, there is no row "mocap".'
    ),
]
RecordedOption = Annotated[Path, typer.Option(help="Folder made by `wayfarer data prepare`.")]
SplitOption = Annotated[
    str, typer.Option(help="Split of the recordings: train, validation or heldout.")
]
JsonOption = Annotated[
    Path | None,
    typer.Option(
        "--json",
        help="File for the rows (.json); tables (.md) and a plot (.png) go beside it.",
        callback=_check_json,
    ),
]
SeedOption = Annotated[int, typer.Option(help="The same seed gives the same rows.", min=0)]
CandidatesOption = Annotated[int, typer.Option(help="Candidate primitives tried per step.", min=1)]
EngineOption = Annotated[
    EngineKind,
    typer.Option(help="Engine that steps the agents; auto: the faster one on this machine."),
]
ThreadsOption = Annotated[int, typer.Option(help="Threads of the engine; 0: all cores.", min=0)]
CountOption = Annotated[int, typer.Option(help="Recorded primitives per gender.", min=1)]
OnlyOption = Annotated[str, typer.Option(help="Rows to make, as ro-1f,ro-2f.", show_default="all")]
