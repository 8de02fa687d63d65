"""Sent and raw beside the recorded ranges, and what rules did in between."""

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
    """The people of one source, of all seeds together: 8 of an order are too few to judge it. The
    same model held 85 to 97 figures with them, by the seed.
    """

    source: str
    people: list[Person] = field(default_factory=list)
    verdicts: list[RangeVerdict] = field(default_factory=list)
    repair: Mapping[str, Row] = field(default_factory=dict)  # of what is sent

    def row(self) -> dict[str, Any]:
        """The figures for JSON."""
        told = {"source": self.source, "repair": dict(self.repair)}
        return told | rows_of(self.verdicts, self.people)


def compare(
    runner: CaseRunner,
    ranges: Ranges,
    people: int,
    seeds: int,
    progress: Progress,
    served: Sequence[Served] = SERVED,
) -> list[Side]:
    """Runs each order with `people` of each seed, as sent and by the model alone, for `seeds` seeds
    from that of the runner on.
    """
    sent, raw, repairs = Side(SENT), Side(RAW), list[Repair]()
    for seed in range(runner.seed, runner.seed + seeds):
        seeded = replace(runner, seed=seed)
        for order in served:
            case, agents = order.case, max(2, round(people * order.case.share))
            with progress(f"{case.name}, {SENT}, seed {seed}") as watch:
                shots, repair = seeded.run_watched(MANEUVER, case, agents, watch)
            sent.people += order.people(shots)
            repairs.append(repair)
            with progress(f"{case.name}, {RAW}, seed {seed}") as watch:
                raw.people += order.people(seeded.run(MANEUVER, case, agents, True, watch))
    sent.repair = Repair.joined(repairs)
    for side in (sent, raw):
        side.verdicts = verdicts_of(side.people, ranges)
    return [sent, raw]


def show(sides: Sequence[Side]) -> None:
    """A row for each figure, with a column for each source; counts; repair."""
    table = Table(title="Two-sided figures: medians of people", title_justify="left")
    for column in ("situation", "figure", "recorded", "n", *(side.source for side in sides)):
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
        report.console.print(f"{side.source}: {count(side.verdicts)}")
        for rule, figures in side.repair.items():
            report.console.print(
                f"    {rule}: {figures['cm_mean']:.2f} cm mean, {figures['cm_p95']:.2f} p95; "
                f"{figures['deg_mean']:.2f}° mean, {figures['deg_p95']:.2f}° p95"
            )
