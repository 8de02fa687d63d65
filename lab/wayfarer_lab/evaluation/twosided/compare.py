"""Sent and raw beside the recorded ranges, with some seeds, and what rules did in between."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from typing import Any

from rich.table import Table

from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.maneuvers.case_runner import CaseRunner
from wayfarer_lab.evaluation.maneuvers.maneuver import RAW, SENT
from wayfarer_lab.evaluation.maneuvers.repair import Repair, Row
from wayfarer_lab.evaluation.tasks import Watch
from wayfarer_lab.evaluation.twosided.ranges import Ranges
from wayfarer_lab.evaluation.twosided.served import SERVED, Served
from wayfarer_lab.evaluation.twosided.verdicts import (
    Person,
    RangeVerdict,
    count,
    rows_of,
    verdicts_of,
)

Progress = Callable[[str], AbstractContextManager[Watch]]
MANEUVER = "two-sided"


@dataclass
class Side:
    """One source with one seed."""

    source: str
    seed: int
    people: list[Person] = field(default_factory=list)
    verdicts: list[RangeVerdict] = field(default_factory=list)
    repair: Mapping[str, Row] = field(default_factory=dict)  # of what is sent

    @property
    def name(self) -> str:
        """The name of its column."""
        return f"{self.source}, seed {self.seed}"

    def row(self) -> dict[str, Any]:
        """The figures for JSON."""
        return {
            "source": self.source,
            "seed": self.seed,
            "repair": dict(self.repair),
        } | rows_of(self.verdicts, self.people)


def compare(
    runner: CaseRunner,
    ranges: Ranges,
    people: int,
    seeds: int,
    progress: Progress,
    served: Sequence[Served] = SERVED,
) -> list[Side]:
    """Runs each order with `people`, as sent and by the model alone, for `seeds` seeds from that of
    the runner on.
    """
    sides = []
    for seed in range(runner.seed, runner.seed + seeds):
        sent, raw, repairs = Side(SENT, seed), Side(RAW, seed), list[Repair]()
        seeded = replace(runner, seed=seed)
        for order in served:
            case, agents = order.case, max(2, round(people * order.case.share))
            with progress(f"{case.name}, {sent.name}") as watch:
                shots, repair = seeded.run_watched(MANEUVER, case, agents, watch)
            sent.people += order.people(shots)
            repairs.append(repair)
            with progress(f"{case.name}, {raw.name}") as watch:
                raw.people += order.people(seeded.run(MANEUVER, case, agents, True, watch))
        sent.repair = Repair.joined(repairs)
        for side in (sent, raw):
            side.verdicts = verdicts_of(side.people, ranges)
            sides.append(side)
    return sides


def show(sides: Sequence[Side]) -> None:
    """A row for each figure, with a column for each source and seed; counts; repair."""
    table = Table(title="Two-sided figures: medians of people", title_justify="left")
    for column in ("situation", "figure", "recorded", "n", *(side.name for side in sides)):
        table.add_column(column, no_wrap=True)
    last = ""
    for row in zip(*(side.verdicts for side in sides), strict=True):
        verdict = row[0]
        if verdict.situation != last:
            table.add_section()
        held = all(v.holds for v in row if v.counts)
        table.add_row(
            verdict.situation if verdict.situation != last else "",
            verdict.figure,
            *verdict.about,
            *(f"{v.middle:.3g} {v.text}" for v in row),
            style=None if held else "red",
        )
        last = verdict.situation
    report.console.print(table)
    for side in sides:
        report.console.print(f"{side.name}: {count(side.verdicts)}")
        for rule, figures in side.repair.items():
            report.console.print(
                f"    {rule}: {figures['cm_mean']:.2f} cm mean, {figures['cm_p95']:.2f} p95; "
                f"{figures['deg_mean']:.2f}° mean, {figures['deg_p95']:.2f}° p95"
            )
