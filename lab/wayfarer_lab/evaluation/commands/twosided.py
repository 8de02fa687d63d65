"""`wayfarer eval ranges`: ranges of recorded people, for the two-sided figures."""

from pathlib import Path
from typing import Annotated

import typer

from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.commands import options
from wayfarer_lab.evaluation.maneuvers.recorded import RecordedClips
from wayfarer_lab.evaluation.twosided import ranges as recorded

app = typer.Typer()


@app.command(short_help="Ranges of recorded people, for the two-sided figures.")
def ranges(
    data: options.Recorded,
    out: Annotated[Path, typer.Option(help="File to write.")] = recorded.FILE,
) -> None:
    """Find in recordings what people are asked to do, measure it, and write the ranges.

    From the 10th to the 90th percentile of the train split, each performer counting once. The file
    is part of the lab, so that no other evaluation needs recordings for it.
    """
    clips = RecordedClips(data, legs=True)
    with report.console.status("clips") as status:
        found = recorded.measure(clips, each=status.update)
    people = sorted({stretch.performer for stretch in found})
    made = recorded.ranges_of(found)
    meta = {"split": recorded.SPLIT, "stretches": len(found), "performers": people}
    recorded.save(made, meta | {"made": report.meta({})}, out)
    recorded.show(made)
