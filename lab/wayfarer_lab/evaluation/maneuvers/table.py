"""Rows, bars and their verdicts: on the screen while they come, and as JSON."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from rich.table import Table

from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.maneuvers.maneuver import RAW, RECORDED, SENT, Bar, Figures, Maneuver
from wayfarer_lab.training.mocap.store import atomically

Key = tuple[str, str]
"""(case, source)"""

VERDICTS: Final = {True: "met", False: "missed", None: "not judged"}


@dataclass(frozen=True)
class Verdict:
    """A bar, its figure, and whether it is met."""

    maneuver: str
    case: str
    bar: Bar
    value: float

    @property
    def met(self) -> bool | None:
        """Whether the bar is met; None without a figure."""
        return self.bar.met(self.value)

    def row(self) -> dict[str, Any]:
        """The verdict for JSON."""
        return {
            "maneuver": self.maneuver,
            "case": self.case,
            "figure": self.bar.figure,
            "value": _known(self.value),
            "bar": self.bar.text(),
            "verdict": VERDICTS[self.met],
            "origin": self.bar.origin,
        }


@dataclass
class Results:
    """All results so far."""

    meta: dict[str, Any]
    rows: list[dict[str, Any]] = field(default_factory=list)
    each: list[dict[str, Any]] = field(default_factory=list)
    verdicts: list[Verdict] = field(default_factory=list)
    two_sided: list[dict[str, Any]] = field(default_factory=list)  # by source

    def add(
        self,
        maneuver: Maneuver,
        rows: Mapping[Key, Figures],
        each: Iterable[dict[str, Any]],
    ) -> None:
        """A manoeuvre that is finished: its rows are those of `SENT`, `RAW` and `RECORDED …`."""
        for (case, source), figures in rows.items():
            known = {name: _known(value) for name, value in figures.items()}
            self.rows.append({"maneuver": maneuver.name, "case": case, "source": source, **known})
        self.each += each
        self.verdicts += judged(maneuver, rows)

    @property
    def missed(self) -> list[Verdict]:
        """Bars that are not met, with the bars that could not be judged."""
        return [verdict for verdict in self.verdicts if verdict.met is not True]

    def write(self, path: Path) -> None:
        """Keys `two_sided`, `rows`, `bars`, `each`, `meta`; appears whole or not at all."""
        whole = {
            "two_sided": self.two_sided,
            "rows": self.rows,
            "bars": [verdict.row() for verdict in self.verdicts],
            "each": self.each,
            "meta": self.meta,
        }
        text = json.dumps(whole, indent=1, allow_nan=False) + "\n"
        path.parent.mkdir(parents=True, exist_ok=True)
        atomically(path, lambda unfinished: unfinished.write_text(text))


def judged(maneuver: Maneuver, rows: Mapping[Key, Figures]) -> list[Verdict]:
    """Verdicts of a manoeuvre's bars on its rows as sent. A bar without a figure, such as a
    comparison with recordings that were not given, is not judged.
    """
    verdicts = []
    for bar in maneuver.bars:
        cases = [bar.case] if bar.case else [case.name for case in maneuver.cases]
        for case in cases:
            value = rows.get((case, SENT), {}).get(bar.figure, math.nan)
            verdicts.append(Verdict(maneuver.name, case, bar, value))
    order = list(dict.fromkeys([case for case, _ in rows] + [v.case for v in verdicts]))
    return sorted(verdicts, key=lambda verdict: order.index(verdict.case))


def show(maneuver: Maneuver, rows: Mapping[Key, Figures], verdicts: Sequence[Verdict]) -> None:
    """Prints a manoeuvre's table: a row for each figure of each case, a column for each source."""
    sources = sorted({source for _, source in rows}, key=_order)
    table = Table(title=f"{maneuver.name}: {maneuver.about}", title_justify="left")
    table.add_column("case")
    table.add_column("figure", no_wrap=True)
    for source in sources:
        table.add_column(source, justify="right")
    table.add_column("bar", justify="right", no_wrap=True)
    table.add_column("")
    bars = {(v.case, v.bar.figure): v for v in verdicts}
    for case in dict.fromkeys(case for case, _ in rows):
        figures = dict.fromkeys(name for c, s in rows if c == case for name in rows[c, s])
        for place, figure in enumerate(figures):
            cells = [_text(rows.get((case, s), {}).get(figure, math.nan)) for s in sources]
            found = bars.get((case, figure))
            bar = [found.bar.text(), VERDICTS[found.met]] if found else ["", ""]
            style = "red" if found and not found.met else None
            table.add_row(case if place == 0 else "", figure, *cells, *bar, style=style)
        table.add_section()
    report.console.print(table)


def show_verdicts(verdicts: Sequence[Verdict]) -> None:
    """All bars in one table."""
    table = Table(title="Bars (of what is sent)", title_justify="left")
    for column in ("manoeuvre", "case", "figure", "value", "bar", "", "from"):
        table.add_column(column)
    for v in verdicts:
        table.add_row(
            v.maneuver, v.case, v.bar.figure, _text(v.value), v.bar.text(), VERDICTS[v.met],
            v.bar.origin, style=None if v.met else "red",
        )  # fmt: skip
    met = sum(v.met is True for v in verdicts)
    report.console.print(table)
    report.console.print(f"{met} of {len(verdicts)} bars are met")


def _order(source: str) -> tuple[int, str]:
    first = [SENT, RAW].index(source) if source in (SENT, RAW) else len(RECORDED)
    return first, source


def _text(value: float) -> str:
    if math.isnan(value):
        return "–"
    return f"{value:.3g}" if abs(value) < 100 else f"{value:.0f}"


def _known(value: float) -> float | None:
    return round(value, 5) if math.isfinite(value) else None
