"""`wayfarer eval define`: definitions of figures."""

from difflib import get_close_matches
from typing import Annotated

import typer

from wayfarer_lab.evaluation.definitions import as_markdown, definitions, groups

app = typer.Typer()


@app.command(short_help="Print what figures mean.")
def define(
    figures: Annotated[
        list[str] | None, typer.Argument(help="Names, as in the tables; all if absent.")
    ] = None,
) -> None:
    """Print what figures mean, for example:

    wayfarer eval define seam_ratio slide_cm_s

    Without a name, print benchmarks/results/figures.md: the definitions of all figures.
    """
    if not figures:
        typer.echo(as_markdown())
        return
    for figure in figures:
        if not (found := definitions(figure)):
            raise typer.BadParameter(f"no table has a figure {figure!r}{_near(figure)}")
        for group, name, text in found:
            typer.echo(f"{name} ({group}): {text}")


def _near(figure: str) -> str:
    known = [name for group in groups() for name in group.figures]
    near = get_close_matches(figure, known, n=3)
    return f"; there is {', '.join(near)}" if near else "; without a name, all are listed"
