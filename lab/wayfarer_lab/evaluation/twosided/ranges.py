"""Ranges of recorded people: made from prepared recordings, kept in `ranges.json` in this folder.

All stretches of each situation are found and measured. Each performer counts once, however often
it is recorded. A range goes from the 10th to the 90th percentile.
"""

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from wayfarer.errors import DataError
from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.maneuvers.recorded import RecordedClips, person_of
from wayfarer_lab.evaluation.twosided.figures import Values
from wayfarer_lab.evaluation.twosided.situations import SITUATIONS, UPPER
from wayfarer_lab.training.mocap.store import atomically

FILE: Final = Path(__file__).with_name("ranges.json")
FORMAT: Final = 1
ENDS: Final = (0.1, 0.9)
"""Quantiles that bound a range."""

SPLIT: Final = "train"
MIN_STRETCHES: Final = 4
"""Stretches that a range needs at least."""


@dataclass(frozen=True)
class Range:
    """Where a figure of recorded people lies."""

    low: float
    high: float
    middle: float
    stretches: int  # 0: given by the literature
    performers: int

    @property
    def width(self) -> float:
        """The 10th and the 90th percentile."""
        return self.high - self.low


Ranges = dict[str, dict[str, Range]]
"""Range of each figure of each situation."""


@dataclass(frozen=True)
class Stretch:
    """A measured stretch of a recording."""

    situation: str
    performer: str
    clip: str
    values: Values


def measure(
    recordings: RecordedClips, split: str = SPLIT, each: Callable[[str], None] = lambda name: None
) -> list[Stretch]:
    """All stretches of a split. `each` is called with every clip's name before it is measured."""
    found = []
    for clip, take, use in recordings.takes(split):
        each(clip.name)
        acted = clip.acted
        hidden = UPPER if acted else frozenset[str]()
        for situation in SITUATIONS.values():
            if acted and not situation.acted:
                continue
            for part in situation.find(take, use):
                values = {
                    name: value
                    for name, value in situation.measure(part).items()
                    if name not in hidden
                }
                found.append(Stretch(situation.name, person_of(clip), clip.source, values))
    return found


def ranges_of(stretches: Iterable[Stretch]) -> Ranges:
    """Ranges of measured stretches, and ranges of the literature."""
    found: Ranges = {}
    every = list(stretches)
    for situation in SITUATIONS.values():
        mine = [stretch for stretch in every if stretch.situation == situation.name]
        row: dict[str, Range] = {}
        for figure in dict.fromkeys(name for stretch in mine for name in stretch.values):
            known = [
                (stretch.values[figure], stretch.performer)
                for stretch in mine
                if np.isfinite(stretch.values.get(figure, np.nan))
            ]
            if len(known) >= MIN_STRETCHES:
                row[figure] = _range(known)
        for figure, (low, high) in situation.given.items():
            row[figure] = Range(low, high, (low + high) / 2, 0, 0)
        found[situation.name] = row
    return found


def _range(known: list[tuple[float, str]]) -> Range:
    values = np.array([value for value, _ in known])
    people = [person for _, person in known]
    weights = np.array([1 / people.count(person) for person in people])
    low, middle, high = quantiles(values, weights, (ENDS[0], 0.5, ENDS[1]))
    return Range(low, high, middle, len(values), len(set(people)))


def quantiles(
    values: NDArray[np.floating[Any]], weights: NDArray[np.floating[Any]], at: tuple[float, ...]
) -> list[float]:
    """Quantiles of values that count by their weights, interpolated between the middles of those;
    with equal weights Hazen's.
    """
    order = np.argsort(values)
    weight = weights[order]
    places = (weight.cumsum() - weight / 2) / weight.sum()
    return [float(v) for v in np.interp(at, places, values[order])]


def save(ranges: Ranges, meta: dict[str, Any], path: Path = FILE) -> None:
    """Writes ranges, rounded to four digits; the file appears whole or not at all."""
    rows = {
        name: {
            figure: {
                k: v if isinstance(v, int) else float(f"{v:.4g}") for k, v in asdict(r).items()
            }
            for figure, r in row.items()
        }
        for name, row in ranges.items()
    }
    document = {"format": FORMAT, "meta": meta, "ranges": rows}
    text = json.dumps(document, indent=1, allow_nan=False) + "\n"
    atomically(path, lambda unfinished: unfinished.write_text(text))


def show(ranges: Ranges) -> None:
    """A table of all."""
    table = Table(title="Ranges of recorded people", title_justify="left")
    for column in ("situation", "figure", "p10", "median", "p90", "stretches", "performers"):
        table.add_column(column, no_wrap=True)
    for name, row in ranges.items():
        for figure, r in row.items():
            cells = [f"{v:.3g}" for v in (r.low, r.middle, r.high)]
            table.add_row(name, figure, *cells, str(r.stretches), str(r.performers))
        table.add_section()
    report.console.print(table)


def load(path: Path = FILE) -> Ranges:
    """Raises DataError when the file is not one of ranges."""
    try:
        document = json.loads(path.read_text())
        if document["format"] != FORMAT:
            raise ValueError(f"format {document['format']}, expected {FORMAT}")
        return {
            name: {figure: Range(**r) for figure, r in row.items()}
            for name, row in document["ranges"].items()
        }
    except (OSError, ValueError, KeyError, TypeError) as error:
        message = f"no ranges ({error}): run `wayfarer eval ranges --data PREPARED`"
        raise DataError(message, str(path)) from error
