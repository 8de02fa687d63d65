"""Whether figures hold: the median of people inside the range, and people not alike."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from rich.table import Table

from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.twosided.ranges import ENDS, Range, Ranges, quantiles
from wayfarer_lab.evaluation.twosided.situations import ALIKE, REPORTED

SPREAD: Final = 0.3
"""Share of a range's width by which people have to differ, from their 10th percentile to the 90th.
"""


@dataclass(frozen=True)
class Person:
    """The figures of one person in one situation."""

    situation: str
    name: str
    values: dict[str, float]


@dataclass(frozen=True)
class RangeVerdict:
    """A figure of people beside the recorded range."""

    situation: str
    figure: str
    range: Range
    people: int  # with a value
    asked: int  # people in this situation
    middle: float  # median of people; NaN when less than half have a value
    spread: float  # p90 - p10 of people ÷ width of the range

    @property
    def counts(self) -> bool:
        """Whether it is among the figures that have to hold."""
        return self.figure not in REPORTED

    @property
    def inside(self) -> bool:
        """Whether the median lies in the range. A figure that cannot be measured does not."""
        return bool(self.range.low <= self.middle <= self.range.high)

    @property
    def differs(self) -> bool:
        """Whether people differ enough, where they have to."""
        return self.figure in ALIKE or self.range.stretches == 0 or self.spread >= SPREAD

    @property
    def holds(self) -> bool:
        """Inside, and not alike."""
        return self.inside and self.differs

    @property
    def about(self) -> tuple[str, str]:
        """The range, and how many stretches and performers made it, for a table."""
        r = self.range
        made = f"{r.stretches}, {r.performers}" if r.stretches else "given"
        return f"{r.low:.3g} … {r.high:.3g}", made

    @property
    def text(self) -> str:
        """The verdict as text for the table."""
        if self.people * 2 < self.asked:
            return "not measured"
        if not self.inside:
            return "low" if self.middle < self.range.low else "high"
        return "holds" if self.differs else "alike"

    def row(self) -> dict[str, Any]:
        """The verdict for JSON."""
        return {
            "situation": self.situation,
            "figure": self.figure,
            "low": self.range.low,
            "high": self.range.high,
            "median": _known(self.middle),
            "spread": _known(self.spread),
            "people": self.people,
            "verdict": self.text,
            "counts": self.counts,
        }


def verdicts_of(people: Iterable[Person], ranges: Ranges) -> list[RangeVerdict]:
    """A verdict for every figure that has a range, in every situation that somebody was in."""
    every, found = list(people), []
    for situation, row in ranges.items():
        mine = [person.values for person in every if person.situation == situation]
        for figure, wanted in row.items() if mine else ():
            values = np.array([values.get(figure, np.nan) for values in mine])
            found.append(_verdict(situation, figure, wanted, values))
    return found


def _verdict(situation: str, figure: str, wanted: Range, values: np.ndarray) -> RangeVerdict:
    known = values[np.isfinite(values)]
    middle = spread = float("nan")
    if len(known) and 2 * len(known) >= len(values):
        low, middle, high = quantiles(known, np.ones(len(known)), (ENDS[0], 0.5, ENDS[1]))
        spread = (high - low) / max(wanted.width, 1e-9)
    return RangeVerdict(situation, figure, wanted, len(known), len(values), middle, spread)


@dataclass(frozen=True)
class Count:
    """How many figures hold, how many medians are inside, and how many figures there are."""

    holds: int
    inside: int
    total: int

    def __str__(self) -> str:
        return f"{self.holds} of {self.total} hold ({self.inside} medians inside)"


def count(verdicts: Sequence[RangeVerdict]) -> Count:
    """Counts figures that hold, of all that count."""
    counted = [verdict for verdict in verdicts if verdict.counts]
    return Count(
        sum(verdict.holds for verdict in counted),
        sum(verdict.inside for verdict in counted),
        len(counted),
    )


def show(title: str, verdicts: Sequence[RangeVerdict]) -> None:
    """A table of all, and counts for each situation and altogether."""
    table = Table(title=title, title_justify="left")
    for column in ("situation", "figure", "recorded", "n", "people", "spread", ""):
        table.add_column(column, no_wrap=True)
    last = ""
    for verdict in verdicts:
        if verdict.situation != last:
            table.add_section()
        table.add_row(
            verdict.situation if verdict.situation != last else "",
            verdict.figure,
            *verdict.about,
            f"{verdict.middle:.3g}",
            f"{verdict.spread:.2f}",
            verdict.text if verdict.counts else f"({verdict.text})",
            style=None if verdict.holds or not verdict.counts else "red",
        )
        last = verdict.situation
    report.console.print(table)
    for situation in dict.fromkeys(verdict.situation for verdict in verdicts):
        mine = [verdict for verdict in verdicts if verdict.situation == situation]
        report.console.print(f"{situation}: {count(mine)}")
    report.console.print(f"{title}: {count(verdicts)}")


def rows_of(verdicts: Sequence[RangeVerdict], people: Sequence[Person]) -> dict[str, Any]:
    """For JSON: `holds`, `inside`, `of`, `verdicts`, and `people` with their figures."""
    counted = count(verdicts)
    return {
        "holds": counted.holds,
        "inside": counted.inside,
        "of": counted.total,
        "verdicts": [verdict.row() for verdict in verdicts],
        "people": [
            {"situation": p.situation, "name": p.name}
            | {figure: _known(value) for figure, value in p.values.items()}
            for p in people
        ],
    }


def _known(value: float) -> float | None:
    return round(value, 5) if np.isfinite(value) else None
