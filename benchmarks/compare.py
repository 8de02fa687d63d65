"""Compares the ratios of two records, never their times: has any become worse?

    python -m benchmarks.compare BEFORE.json AFTER.json [--tolerance 0.1]

Both are files of `benchmarks.record`, or of single benchmarks (`--json`). Ratios divide a cost
by a floor that was measured in the same run (a step against its matrix products at the
machine's ceiling, a server with a reader against one without), so files of different machines may
be compared. A ratio may be worse by the tolerance (0.1: a tenth). Ends with 1 when one is worse, or
is missing although its benchmark was run.
"""

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

WORSE, GONE = "worse", "gone"
FAULTS = (WORSE, GONE)

Ratios = dict[tuple[str, str], dict[str, Any]]
"""Ratios by benchmark and name."""


@dataclass(frozen=True)
class Change:
    """The comparison of one ratio."""

    part: str
    name: str
    before: float | None
    after: float | None
    verdict: str


def ratios(document: dict[str, Any], stem: str = "") -> Ratios:
    """Ratios of a record, or of a single benchmark whose file is named `stem`."""
    parts = document.get("parts") or {stem: document}
    return {
        (part, name): found
        for part, result in parts.items()
        for name, found in result.get("ratios", {}).items()
    }


def changes(before: Ratios, after: Ratios, tolerance: float) -> list[Change]:
    """A change for each ratio, in the order of first occurrence."""
    measured = {part for part, _ in after}
    found = []
    for key in dict.fromkeys((*before, *after)):
        part, name = key
        old, new = before.get(key), after.get(key)
        if old is None:
            verdict = "new"
        elif new is None:
            verdict = GONE if part in measured else "not measured"
        else:
            verdict = _verdict(old["value"], new["value"], new["better"], tolerance)
        was, now = (one["value"] if one else None for one in (old, new))
        found.append(Change(part, name, was, now, verdict))
    return found


def _verdict(before: float, after: float, better: str, tolerance: float) -> str:
    gain = after - before if better == "higher" else before - after
    if abs(gain) <= tolerance * abs(before):
        return "same"
    return "better" if gain > 0 else WORSE


def main() -> int:
    """Prints a table; returns 1 when a ratio is worse or missing."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--tolerance", type=float, default=0.1)
    asked = parser.parse_args()
    # Two files of one benchmark may have any names; they are the same part.
    before, after = (
        ratios(json.loads(path.read_text()), "benchmark") for path in (asked.before, asked.after)
    )
    found = changes(before, after, asked.tolerance)
    if not found:
        print(f"no ratios in {asked.before} and {asked.after}: are they of benchmarks.record?")
        return 1
    table = Table("benchmark", "ratio", "before", "after", "change", "")
    for change in found:
        numbers = (change.before, change.after)
        shown = ["–" if number is None else f"{number:.3g}" for number in numbers]
        both = change.before and change.after is not None
        shift = f"{change.after / change.before - 1:+.0%}" if both else ""  # type: ignore[operator]
        colour = "red" if change.verdict in FAULTS else ""
        table.add_row(change.part, change.name, *shown, shift, change.verdict, style=colour)
    Console(width=140).print(table)
    worse = sum(change.verdict in FAULTS for change in found)
    print(f"{worse} of {len(found)} ratios are worse or gone (tolerance {asked.tolerance:.0%})")
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
