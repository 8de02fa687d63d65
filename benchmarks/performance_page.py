"""Writes benchmarks/results/performance.md, and its pictures, from its folder's performance_*.json.

python -m benchmarks.performance_page
"""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from benchmarks import performance_plots
from benchmarks.bench import Row, text

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
PAGE = RESULTS / "performance.md"
IMAGES = RESULTS / "images"

INTRO = """# Performance

Measured by `python -m benchmarks.record`, written by `python -m benchmarks.performance_page`;
nothing is typed in. The `--help` of each benchmark explains what it measures and its columns.
*Ratios* divide a cost by a floor that was measured in the same run, so they can be compared between
machines: `python -m benchmarks.compare OLD.json NEW.json`.

An agent keeps real time only if it is stepped every 0.2 s. Lateness is the time from the scheduled
display of a primitive to its arrival at the client, on the same machine as the server
(`wayfarer load --help`).
"""

TITLES = {
    "step": "The step",
    "quantised": "What int8 saves, and its errors",
    "paper_s3": "Table S3 of the paper",
    "startup": "Start",
    "memory": "Memory",
    "transport": "Sending to one client",
    "overhead": "Everything but the engine",
    "gpu": "The torch engine, on a GPU where there is one",
    "navigation": "Scenes and paths",
    "service": "The whole service",
}
TRANSPOSED = ("service",)
"""Parts with few rows and many columns, whose names go down."""

Part = dict[str, Any]


def title(part: str) -> str:
    """Title of a part's section."""
    kind = next((kind for kind in TITLES if part.startswith(kind)), part)
    which = part.removeprefix(kind).strip("_").split("_k")
    engine = which[0] and f": {which[0]}"
    search = f", K = {which[1]}" if len(which) > 1 else ""
    return TITLES.get(kind, part) + engine + search


def groups(rows: Iterable[Row]) -> list[list[Row]]:
    """Rows that have the same columns, in order."""
    found: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row), []).append(row)
    return list(found.values())


def table(rows: list[Row], transposed: bool = False) -> str:
    """Table of rows with the same columns, as markdown."""
    lines = [list(rows[0]), *([cell(value) for value in row.values()] for row in rows)]
    if transposed:
        lines = [list(line) for line in zip(*lines, strict=True)]
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def cell(value: object) -> str:
    """Text of a table's cell."""
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else text(value)


def origin(part: Part) -> str:
    """Command, date, machine, commit and versions of a part."""
    meta = part["meta"]
    machine = meta["machine"]
    flags = ", ".join(machine["flags"]) or "no wide instructions"
    where = f"{machine['cpu']}, {machine['cores']} cores ({flags}), {machine['ram_gb']:g} GB"
    versions = ", ".join(f"{name} {number}" for name, number in meta["versions"].items())
    quick = "**A quick look, not a record.** " if meta["quick"] else ""
    busy = f", load {machine['load']:g} before it began" if machine["load"] > 0.5 else ""
    return (
        f"`{part['command']}`  \n{quick}{meta['date'][:10]}, {where}{busy}, "
        f"commit {meta['commit'][:7]}; {versions}\n"
    )


def section(name: str, part: Part, drawn: str | None = None) -> str:
    """One benchmark of one record; `drawn` is its picture's file."""
    lines = [f"### {title(name)}\n", origin(part)]
    if "failure" in part:
        lines.append(f"It failed:\n\n```\n{part['failure'].strip()}\n```\n")
    if drawn:
        lines.append(f"![{title(name)}](images/{drawn})\n")
    lines += [
        table(rows, name.startswith(TRANSPOSED)) + "\n"
        for key in ("rows", "gemm", "shares")
        for rows in groups(part.get(key, []))
    ]
    if ratios := part.get("ratios"):
        found = [
            {"ratio": k, "value": v["value"], "better": v["better"]} for k, v in ratios.items()
        ]
        lines.append(table(found) + "\n")
    return "\n".join(lines)


def page(records: dict[str, Part], picture: Callable[[str, str, Part], str | None]) -> str:
    """All records, by name. `picture(record, part's name, part)` gives a file in IMAGES."""
    parts = [INTRO]
    for name, record in records.items():
        machine = next(iter(record["parts"].values()))["meta"]["machine"]
        parts.append(f"## {name}: {machine['cpu']}, {machine['cores']} cores\n")
        parts += [
            section(part, found, picture(name, part, found))
            for part, found in record["parts"].items()
        ]
    return "\n".join(parts)


def main() -> None:
    """Writes the page."""
    files = sorted(RESULTS.glob("performance_*.json"))
    records = {f.stem.removeprefix("performance_"): json.loads(f.read_text()) for f in files}

    def picture(record: str, name: str, part: Part) -> str | None:
        return performance_plots.draw(IMAGES, f"performance_{record}_{name}.png", name, part)

    PAGE.write_text(page(records, picture))


if __name__ == "__main__":
    main()
