"""The paper's own figures, and our rows next to them: `published.toml`, and sources of our rows."""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from wayfarer_lab.evaluation.paper.results import Source

Values = tuple[float, ...]

UNTRAINED_PPO: Final = (
    "not measured here: `wayfarer train policy --config paper/policy_{0}_approach`, `wayfarer "
    "export`, `wayfarer eval control --policy-{0} --lead` (docs/models.md, *PPO from scratch*)"
)
RUNS: Final = "`python -m benchmarks.paper_runs {0} --data PREPARED` trains and measures it"
"""The commands that make what is not trained."""
SHORT: Final = RUNS.format("short --seed SEED")


@dataclass(frozen=True)
class Line:
    """A row of a table; `paper` has the paper's values of the table's first figures."""

    name: str
    paper: Values = ()
    source: Source | None = None
    why: str = ""  # the missing part, if there is no measured row


@dataclass(frozen=True)
class Exhibit:
    """A table or figure of the paper. `figures`: ours → what the paper calls it."""

    title: str
    about: str
    figures: Mapping[str, str]
    lines: tuple[Line, ...]


def _rows(*files: str) -> Callable[[str], Source]:
    return lambda name: Source(name, files)


control_row = _rows("control_paper*", "control")
realism_row = _rows("realism")
predictor_row = _rows("predictor_paper*")
alike_row = _rows("realism_paper*")
direct_row = _rows("realism_direct*")
reprojection_row = _rows("reprojection")
bodies_row = _rows("bodies_paper*")
skating_row = _rows("skating")
"""Rows of a table of `wayfarer eval`. Predictors in files `…_paper*` are trained alike."""


def short_row(table: str, name: str) -> Source:
    """A row of a table of the short trainings, which differ only in their seed."""
    return Source(name, (f"{table}_short*",))


END_TO_END: Final = Source("ro-2f", ("realism_e2e*",))
REGRESSED: Final = "regressed"
OPTIMISED: Final = "optimised, 100 iterations"

_FILE: Final = tomllib.loads(Path(__file__).with_name("published.toml").read_text("utf-8"))


def _line(row: Mapping[str, Any]) -> Line:
    source = Source(row["row"], tuple(row["files"])) if "row" in row else None
    why = row.get("why", "")
    return Line(row["name"], tuple(row.get("paper", ())), source, _FILE["whys"].get(why, why))


EXHIBITS: Final = tuple(
    Exhibit(one["title"], one["about"], one["figures"], tuple(map(_line, one["lines"])))
    for one in _FILE["exhibits"]
)
COMMANDS: Final[Mapping[str, str]] = _FILE["commands"]
"""Commands of results that do not hold their own (benchmarks/results/README.md)."""

S3: Final = {int(bodies): float(seconds) for bodies, seconds in _FILE["s3"].items()}
"""Bodies → seconds per primitive (Table S3, one Quadro 6000)."""

PICTURES: Final[Mapping[str, str]] = _FILE["pictures"]
"""Pictures of the paper, and where ours are or why there is none."""

MOTIONS: Final = {name: (one["title"], one["about"]) for name, one in _FILE["motions"].items()}
"""Pictures that `wayfarer eval figures` and `failures` make: title, and what they show."""
