"""`wayfarer eval paper`: the page that has the paper's tables beside ours."""

import json
from pathlib import Path
from typing import Annotated, Final

import typer

from wayfarer.errors import DataError
from wayfarer_lab.evaluation.paper.page import page
from wayfarer_lab.evaluation.paper.results import ResultsFolder
from wayfarer_lab.evaluation.report import console

app = typer.Typer()

BENCHMARK: Final = "performance_*.json"
"""Of `python -m benchmarks.record`; its part `paper_s3_onnxruntime` is Table S3."""


@app.command(short_help="The paper's tables and figures beside ours, as a page.")
def paper(
    results: Annotated[
        Path,
        typer.Option(help="Folder of results: `wayfarer eval TABLE --json FOLDER/TABLE.json`."),
    ] = Path("benchmarks/results"),
    out: Annotated[Path, typer.Option(help="Markdown file to write.")] = Path("docs/paper.md"),
) -> None:
    """Write the paper's tables and figures beside ours, from JSON results alone.

    Rows are found by the names of files and rows: TABLE.json, or TABLE_paper*.json for networks
    that were trained as the paper has it; several such files stand for several trainings and give
    mean and range. What is missing is named, with the reason. Nothing is measured here: see
    `wayfarer eval --help` for the tables.
    """
    text = page(ResultsFolder(results), results.as_posix(), runtime(results))
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(text, encoding="utf-8")
    console.print(f"wrote {out}", highlight=False)


def runtime(folder: Path) -> dict[int, float] | None:
    """Seconds of a primitive by number of bodies, as a server cuts them into calls.

    None when no benchmark is there; raises DataError when it is not as `benchmarks.record` writes.
    """
    found = sorted(folder.glob(BENCHMARK))
    if not found:
        return None
    try:
        rows = json.loads(found[-1].read_text(encoding="utf-8"))["parts"]["paper_s3_onnxruntime"]
        return {
            int(row["bodies"]): min(float(row["one_call_s"]), float(row["best_calls_s"]))
            for row in rows["rows"]
        }
    except (ValueError, KeyError, TypeError) as error:
        raise DataError(f"{found[-1]}: holds no Table S3: {error!r}") from None
