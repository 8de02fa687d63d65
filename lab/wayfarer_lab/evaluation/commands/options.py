"""Options that several tables share."""

import importlib
from pathlib import Path
from typing import Annotated

import typer

from wayfarer.engines.engine import EngineKind
from wayfarer_lab.evaluation.report import check_origin


def _check_json(path: Path | None) -> Path | None:
    """Refuse what would fail after an evaluation of minutes before it: bad names, no plots, and
    sources that nobody could name.
    """
    if path is not None:
        if path.suffix != ".json":
            raise typer.BadParameter(f"{path} must end in .json")
        check_origin()
        importlib.import_module("matplotlib")
    return path


ModelsOption = Annotated[Path, typer.Option(help="Folder of a motion model.")]
RunsOption = Annotated[
    Path | None,
    typer.Option(help="Folder of training runs whose networks take the place of the models'."),
]
DataOption = Annotated[
    Path | None,
    typer.Option(help='Folder of `wayfarer data prepare`; without, there is no row "mocap".'),
]
RecordedOption = Annotated[Path, typer.Option(help="Folder of `wayfarer data prepare`.")]
SplitOption = Annotated[str, typer.Option(help="train, validation or heldout.")]
JsonOption = Annotated[
    Path | None,
    typer.Option(
        "--json", help="Also write the rows here; beside it .md and .png.", callback=_check_json
    ),
]
SeedOption = Annotated[int, typer.Option(help="The same seed gives the same rows.", min=0)]
CandidatesOption = Annotated[int, typer.Option(help="Candidates of the search.", min=1)]
EngineOption = Annotated[
    EngineKind, typer.Option(help="Engine that steps the agents; auto: the faster one here.")
]
ThreadsOption = Annotated[int, typer.Option(help="Threads of the engine; 0: all cores.", min=0)]
CountOption = Annotated[int, typer.Option(help="Recorded primitives per gender.", min=1)]
