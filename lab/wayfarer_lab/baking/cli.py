"""`wayfarer body bake` and `wayfarer body clothes`."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TaskID, TimeElapsedColumn
from rich.table import Table

from wayfarer.body.library import DETAILS, FOLDER
from wayfarer_lab.baking import bake as baker
from wayfarer_lab.baking import wardrobe


def bake(
    output: Annotated[Path, typer.Option(help="Folder for the npz files and manifest.")] = FOLDER,
    identities: Annotated[
        int, typer.Option(min=200, help="Random adults per gender behind the betas.")
    ] = baker.IDENTITIES,
) -> None:
    """Bake the anny52 body from the anny package and print its errors against anny."""
    console = Console()
    with _progress(console) as show:
        report = baker.bake(output, identities, show)
    for gender, figures in report.items():
        table = Table("error, mm", "mean", "max", title=f"anny52 {gender} against anny")
        for name, error in figures["error_mm"].items():
            table.add_row(name, f"{error['mean']:.4f}", f"{error['max']:.2f}")
        console.print(table)
    console.print(f"written to {output}")


def clothes(
    folder: Annotated[Path, typer.Argument(help="Where the archive of MakeHuman was unpacked.")],
    output: Annotated[Path, typer.Option(help="Folder for the npz file and manifest.")] = FOLDER,
) -> None:
    """Bake clothes, shoes and hair of MakeHuman (CC0) for the shipped anny52 body.

    The folder is that with `base/clothes` and `base/hair`:
    https://github.com/makehumancommunity/makehuman-assets.
    """
    console = Console()
    with _progress(console) as show:
        sizes = wardrobe.bake(folder, output, progress=show)
    table = Table("garment", *DETAILS, title="vertices")
    for name, counts in sizes.items():
        table.add_row(name, *(str(count) for count in counts.values()))
    console.print(table)
    console.print(f"written to {output}")


@contextmanager
def _progress(console: Console) -> Iterator[Callable[[str, int, int], None]]:
    """Bars, one for each stage: to be called with its name, the steps done and those in all."""
    columns = (*Progress.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as bars:
        tasks: dict[str, TaskID] = {}

        def show(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=total)
            bars.update(tasks[stage], completed=done)

        yield show
