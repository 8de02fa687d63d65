"""What several tables share: their origin, the bar over seconds of motion, the end of a command."""

import json as json_module
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.tasks import Watch


def origin(
    models: Path, runs: Path | None, data: Path | None, split: str, seed: int
) -> dict[str, Any]:
    """The origin of a table, for its meta part."""
    return {
        "seed": seed,
        "models": str(models),
        "runs": str(runs) if runs else None,
        "cpu_minutes": training_minutes(runs) if runs else None,
        "steps": training_steps(runs) if runs else None,
        "data": str(data) if data else None,
        "split": split if data else None,
    }


def training_minutes(runs: Path) -> dict[str, float | None]:
    """Minutes of processor time of each training in a folder of runs; None: not counted.

    A run that another started from is counted separately.
    """
    return {
        path.parent.name: json_module.loads(path.read_text())["cpu_minutes"]
        for path in sorted(runs.glob("*/effort.json"))
    }


def training_steps(runs: Path) -> dict[str, str]:
    """Steps and batch of each training in a folder of runs: "800 × 128"."""
    found = {}
    for path in sorted(runs.glob("*/effort.json")):
        batch = json_module.loads((path.parent / "config.json").read_text()).get("batch")
        steps = json_module.loads(path.read_text())["steps"]
        found[path.parent.name] = f"{steps} × {batch}" if batch else str(steps)
    return found


@contextmanager
def progress(title: str) -> Iterator[Watch]:
    """A bar over seconds of motion."""
    with report.progress() as bar:
        task = bar.add_task(f"{title} (seconds of motion)", total=None)
        yield lambda done, total: bar.update(task, completed=int(done), total=int(total))


def write_figures(path: Path, figures: dict[str, Any], about: dict[str, Any]) -> None:
    """Writes what pictures of the paper's page are drawn from, with its origin."""
    made = {"figures": figures, "meta": report.meta(about)}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json_module.dumps(made, separators=(",", ":"), allow_nan=False) + "\n")
    report.console.print(f"wrote {path}: {', '.join(figures)}", highlight=False)


def finish(json: Path | None, tables: dict[str, list[Row]], **about: Any) -> None:
    """Prints the tables, and writes them as JSON and Markdown when asked to."""
    for title, rows in tables.items():
        report.show(title, rows)
    if json is not None:
        report.write(json, tables, **about)
