"""Every figure of the published tables and of the bars is defined, on the page too."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from wayfarer_lab.evaluation.commands import app
from wayfarer_lab.evaluation.commands.maneuvers import MANEUVERS
from wayfarer_lab.evaluation.definitions import as_markdown, definitions, groups
from wayfarer_lab.evaluation.twosided import ranges

ROOT = Path(__file__).parents[3]
OTHERS = ("performance", "figures", "failures")  # the cost of a server, the bodies of pictures
TABLES = [p for p in (ROOT / "benchmarks/results").glob("*.json") if not p.name.startswith(OTHERS)]


def test_every_published_figure_is_defined() -> None:
    rows = [row for table in TABLES for row in json.loads(table.read_text())["rows"]]
    names = {name for row in rows for name in row} - {"name", "maneuver", "case", "source"}
    assert len(names) > 100
    assert sorted(name for name in names if not definitions(name)) == []


def test_every_bar_is_defined() -> None:
    names = {bar.figure for maneuver in MANEUVERS.values() for bar in maneuver.bars}
    assert sorted(name for name in names if not definitions(name)) == []


def test_every_two_sided_figure_is_defined_and_nothing_else() -> None:
    names = {name for row in ranges.load().values() for name in row}
    assert sorted(name for name in names if not definitions(name)) == []
    mine = set(groups()[-1].figures) - {"repair"}
    assert mine <= names, "no definition without a figure"


def test_the_page_is_what_the_command_prints() -> None:
    answer = CliRunner().invoke(app, ["define"])
    assert (
        answer.output
        == as_markdown() + "\n"
        == (ROOT / "benchmarks/results/figures.md").read_text()
    )


@pytest.mark.parametrize(
    ("figure", "groups"),
    [
        ("seam_ratio", ["All tables"]),
        ("off_heading_deg_median", ["maneuvers"]),
        ("success", ["control", "scenes"]),
    ],
)
def test_a_figure_is_looked_up_by_name_then_by_pattern(figure: str, groups: list[str]) -> None:
    assert [group for group, _, _ in definitions(figure)] == groups


def test_an_unknown_figure_is_refused_with_near_ones() -> None:
    answer = CliRunner().invoke(app, ["define", "seam_ration"])
    assert answer.exit_code == 2 and "seam_ratio" in answer.output
