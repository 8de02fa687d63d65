"""Rows of figures → a table on the screen; JSON with its origin, and Markdown.

A report is a few titled tables. Every table's rows share their figures, and the recordings' own
row is called "mocap" (`MOCAP`), made by the same code.
"""

import json
import math
import platform
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from wayfarer import __version__
from wayfarer.errors import FailedPrecondition
from wayfarer.process.processor import cores
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.metrics import VERSION

UNKNOWN: Final = "unknown"
"""Used where no commit is known."""

Tables = Mapping[str, Sequence[Row]]
"""Title → rows."""

console = Console(stderr=True, width=None if sys.stderr.isatty() else 160)
"""Tables and progress go to stderr, so that stdout stays free; wide ones into a log file."""


def progress() -> Progress:
    """The progress bar of all evaluations."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
    )


def show(title: str, rows: Sequence[Row]) -> None:
    """Prints rows as a table: a column per row, since rows have many figures and short names."""
    if not rows:
        return
    table = Table(title=title)
    table.add_column("", no_wrap=True)
    for row in rows:
        table.add_column(str(row["name"]), justify="right")
    for figure in _figures(rows):
        table.add_row(figure, *(_text(row.get(figure)) for row in rows))
    console.print(table)


def write(path: Path, tables: Tables, **about: Any) -> None:
    """Writes `{"rows": […], "meta": {…}}` to `path` (.json), and .md next to it.

    `rows` are those of all tables; `about` (arguments, seed) joins the meta part. A figure that
    could not be measured (NaN) becomes null: JSON has no NaN.
    """
    rows = [{k: _finite(v) for k, v in row.items()} for rows in tables.values() for row in rows]
    made = meta(about)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"rows": rows, "meta": made}, indent=2, allow_nan=False) + "\n")
    path.with_suffix(".md").write_text(markdown(path.stem, tables, made))


def markdown(title: str, tables: Tables, made: Mapping[str, Any]) -> str:
    """The tables and their origin, as one page. The shorter of rows and figures become columns."""
    parts = [f"# {title}\n"]
    for name, rows in tables.items():
        if rows:
            parts.append(f"## {name}\n\n{_markdown_table(rows)}\n")
    lines = [f"- {key}: {value}" for key, value in made.items() if not isinstance(value, dict)]
    machine, versions = made["machine"], made["versions"]
    lines += [f"- {machine['cpu']}, {machine['cores']} cores"]
    lines += ["- " + ", ".join(f"{name} {number}" for name, number in versions.items())]
    return "\n".join([*parts, *lines]) + "\n"


def _markdown_table(rows: Sequence[Row]) -> str:
    figures = _figures(rows)
    lines = [["", *figures]]
    lines += [[str(row["name"]), *(_text(row.get(figure)) for figure in figures)] for row in rows]
    if len(rows) < len(figures):
        lines = [list(line) for line in zip(*lines, strict=True)]
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _figures(rows: Sequence[Row]) -> list[str]:
    """Names of all figures, in order of first appearance."""
    return list(dict.fromkeys(key for row in rows for key in row if key != "name"))


def meta(about: dict[str, Any]) -> dict[str, Any]:
    """When, where and with what figures were made."""
    return {
        "command": shlex.join(["wayfarer", *sys.argv[1:]]),
        **about,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": {"cpu": _cpu(), "cores": cores(), "system": platform.platform()},
        "commit": commit(),
        "metrics_version": VERSION,
        "versions": {
            "wayfarer": __version__,
            "python": platform.python_version(),
            **{name: _installed(name) for name in ("numpy", "onnxruntime")},
        },
    }


def _text(value: float | int | str | None) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def _finite(value: float | int | str) -> float | int | str | None:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _cpu() -> str:
    """The processor's name; `platform.processor()` is empty on most Linux systems."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def commit() -> str:
    """What source the figures come from: a git commit, `-dirty` when changed since; of an
    installed package its version. "unknown" for files that are neither: see `check_origin`.
    """
    here = Path(__file__).resolve()

    def git(*arguments: str) -> str:
        command = ["git", *arguments]
        answer = subprocess.run(
            command, cwd=here.parent, capture_output=True, text=True, check=True
        )
        return answer.stdout.strip()

    try:
        git("ls-files", "--error-unmatch", here.name)  # a checkout of this, not one around it
        return git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (FileNotFoundError, subprocess.CalledProcessError):
        installed = "site-packages" in here.parts
        return f"release {_installed('wayfarer-lab')}" if installed else UNKNOWN


def check_origin() -> None:
    """Raises FailedPrecondition when the commit or version of the code is unknown."""
    if commit() == UNKNOWN:
        raise FailedPrecondition(
            "these sources are neither a git checkout nor an installed package, so nobody could "
            "say what made the figures; run from a checkout, or without --json"
        )


def _installed(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
