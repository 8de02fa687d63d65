"""The page of results: of one release, or marked."""

import json
from pathlib import Path

import pytest

from benchmarks import results_page


def result(commit: str, **more: object) -> dict[str, object]:
    return {
        "rows": [{"name": "policy", "success": 1.0}],
        "meta": {
            "commit": commit,
            "date": "2026-11-22T00:00:00",
            "machine": {"cpu": "Xeon", "cores": 2},
        },
        **more,
    }


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(results_page, "RESULTS", tmp_path)
    monkeypatch.setattr(results_page, "PAGE", tmp_path / "README.md")
    monkeypatch.setattr("sys.argv", ["results_page.py"])
    for name in ("skating", "bodies", "control"):
        (tmp_path / f"{name}.json").write_text(json.dumps(result("abc1234")))
    return tmp_path


def test_tables_of_one_commit_make_a_page(results: Path) -> None:
    results_page.main()
    page = (results / "README.md").read_text()
    assert page.count("commit abc1234\n") == 3 and "stale" not in page


@pytest.mark.parametrize("commit", ["unknown", "abc1234-dirty", "def5678"])
def test_a_table_of_another_commit_is_refused_or_marked(
    results: Path, monkeypatch: pytest.MonkeyPatch, commit: str
) -> None:
    (results / "control.json").write_text(json.dumps(result(commit)))
    with pytest.raises(SystemExit, match="control"):
        results_page.main()
    assert not (results / "README.md").exists()
    monkeypatch.setattr("sys.argv", ["results_page.py", "--stale"])
    results_page.main()
    page = (results / "README.md").read_text()
    assert page.count("**stale**") == 1 and "Not of one release" in page


def test_bars_stand_beside_raw_and_recorded(results: Path) -> None:
    rows = [
        {"maneuver": "turn", "case": "90°", "source": source, "lifts": value}
        for source, value in (("sent", 0.5), ("raw", 0.25), ("recorded", 3.0))
    ]
    bar = {
        "maneuver": "turn", "case": "90°", "figure": "lifts", "value": 0.5, "bar": "≥ 2",
        "verdict": "missed", "origin": "issue 18",
    }  # fmt: skip
    made = result("abc1234") | {"rows": rows, "bars": [bar]}
    (results / "maneuvers.json").write_text(json.dumps(made))
    results_page.main()
    page = (results / "README.md").read_text()
    assert "| turn | 90° | lifts | 0.500 | 0.250 | 3.000 | ≥ 2 | missed |" in page
    assert "0 of 1 bars are met" in page
