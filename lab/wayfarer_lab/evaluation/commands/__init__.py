"""`wayfarer eval …`: tables on the screen, and with --json the rows in a file with their origin."""

import typer

from wayfarer_lab.evaluation.commands import (
    control,
    define,
    everything,
    maneuvers,
    paper,
    recorded,
    rollouts,
    scenes,
    twosided,
)

app = typer.Typer(
    help="Measure motion and models: one table per command. "
    "docs/evaluation.md explains the tables.",
    no_args_is_help=True,
    add_completion=False,
)
for part in (
    rollouts,
    recorded,
    control,
    maneuvers,
    twosided,
    scenes,
    paper,
    everything,
    define,
):
    app.add_typer(part.app)  # without a name: its commands are siblings of the others
