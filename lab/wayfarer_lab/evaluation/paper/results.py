"""Results that `wayfarer eval … --json` has written: which of them hold a row, and their origin."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

from wayfarer.errors import DataError


@dataclass(frozen=True)
class Result:
    """One JSON file."""

    path: Path
    rows: Sequence[Mapping[str, Any]]
    meta: Mapping[str, Any]

    def row(self, name: str) -> Mapping[str, Any] | None:
        """The first row of that name, figures of all of its tables together."""
        found: dict[str, Any] = {}
        for row in self.rows:
            if row.get("name") == name:
                found = {**row, **found}
        return found or None


@dataclass(frozen=True)
class Source:
    """Where a row comes from: the first pattern of `files` of which a file holds row `name`.

    A pattern that several files match stands for several trainings, one file each.
    """

    name: str
    files: tuple[str, ...]


@dataclass(frozen=True)
class Measured:
    """A row of ours: its figures in each training, and the files they come from."""

    trainings: Sequence[Mapping[str, Any]]
    results: Sequence[Result]

    def values(self, figure: str) -> list[float]:
        """The figure in each training in which it could be measured."""
        values = [row.get(figure) for row in self.trainings]
        return [float(v) for v in values if v is not None]

    def text(self, figure: str) -> str:
        """The figure; of several trainings the mean, and the least and the largest."""
        values = self.values(figure)
        if not values:
            return "–"
        if len(values) == 1:
            return number(values[0])
        return f"{number(fmean(values))} ({number(min(values))}…{number(max(values))})"


class ResultsFolder:
    """A folder of results, each file read once."""

    def __init__(self, folder: Path) -> None:
        """Raises DataError when there is no result, or one cannot be read."""
        self.found: dict[str, Result] = {}
        for path in sorted(folder.glob("*.json")):
            try:
                text = json.loads(path.read_text(encoding="utf-8"))
            except (OSError, ValueError) as error:
                raise DataError(f"{path}: is no result: {error}") from None
            if isinstance(text, dict) and {"rows", "meta"} <= text.keys():
                self.found[path.stem] = Result(path, text["rows"], text["meta"])
        if not self.found:
            raise DataError(f"{folder} holds no result of `wayfarer eval … --json`")

    def measured(self, source: Source) -> Measured | None:
        """The row of a source; None when no file has it."""
        for pattern in source.files:
            held = [
                (row, result)
                for stem, result in self.found.items()
                if Path(stem).match(pattern) and (row := result.row(source.name))
            ]
            if held:
                return Measured([row for row, _ in held], [result for _, result in held])
        return None


def number(value: float) -> str:
    """Text with as many digits as are worth reading."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
