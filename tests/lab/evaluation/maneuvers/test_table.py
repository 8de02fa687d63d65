"""Verdicts, rows and files."""

import json
from math import nan
from pathlib import Path

import pytest

from wayfarer_lab.evaluation.maneuvers.maneuver import RAW, SENT, Bar, Case, Maneuver, MeasuredTake
from wayfarer_lab.evaluation.maneuvers.table import Results, judged

CASES = (Case("a", 1.0, lambda n, r: []), Case("b", 1.0, lambda n, r: []))


def maneuver(*bars: Bar) -> Maneuver:
    return Maneuver("hop", "up and down", 4, CASES, _nothing, lambda shots, each: {}, bars)


def _nothing(shot: MeasuredTake) -> dict[str, float]:
    return {}


@pytest.mark.parametrize(
    ("bar", "value", "met", "text"),
    [
        (Bar("x", low=2), 2.0, True, "≥ 2"),
        (Bar("x", low=2), 1.99, False, "≥ 2"),
        (Bar("x", high=0.01), 0.0, True, "≤ 0.01"),
        (Bar("x", high=0.01), 0.02, False, "≤ 0.01"),
        (Bar("x", 0.9, 1.1), 1.2, False, "0.9 … 1.1"),
        (Bar("x", 0.9, 1.1), 1.0, True, "0.9 … 1.1"),
        (Bar("x", high=1), nan, None, "≤ 1"),
    ],
)
def test_a_bar_says_what_is_allowed(bar: Bar, value: float, met: bool | None, text: str) -> None:
    assert bar.met(value) is met and bar.text() == text


def test_every_case_is_judged_on_what_is_sent() -> None:
    rows = {("a", SENT): {"x": 1.0}, ("a", RAW): {"x": 9.0}, ("b", SENT): {"x": 3.0}}
    verdicts = judged(maneuver(Bar("x", high=2), Bar("x", low=2, case="b")), rows)
    assert [(v.case, v.bar.text(), v.met) for v in verdicts] == [
        ("a", "≤ 2", True), ("b", "≤ 2", False), ("b", "≥ 2", True),
    ]  # fmt: skip


def test_what_was_not_measured_is_not_met() -> None:
    results = Results({})
    results.add(maneuver(Bar("y", high=2)), {("a", SENT): {"x": 1.0}, ("b", SENT): {"y": nan}}, [])
    assert [v.met for v in results.verdicts] == [None, None]
    assert len(results.missed) == 2


def test_the_file_holds_rows_bars_and_every_take(tmp_path: Path) -> None:
    results = Results({"seed": 7})
    rows = {("a", SENT): {"x": 1.0, "z": nan}, ("b", SENT): {"x": 3.0}}
    results.add(maneuver(Bar("x", high=2)), rows, [{"maneuver": "hop", "take": "agent 0", "x": 1}])
    results.write(tmp_path / "new" / "hop.json")
    made = json.loads((tmp_path / "new" / "hop.json").read_text())
    assert made["rows"][0] == {
        "maneuver": "hop", "case": "a", "source": SENT, "x": 1.0, "z": None
    }  # fmt: skip
    assert [bar["verdict"] for bar in made["bars"]] == ["met", "missed"]
    assert made["each"][0]["take"] == "agent 0" and made["meta"] == {"seed": 7}
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["hop.json"]
