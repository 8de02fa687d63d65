"""Reports: what a reader of the JSON file may rely on."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.evaluation.recordings import SPEED, write_recordings
from wayfarer.evaluation import report
from wayfarer.evaluation.commands import app
from wayfarer.evaluation.gait import Row

ROWS: list[Row] = [
    {"name": "model", "slide_cm_s": 5.25, "windows": 3},
    {"name": "mocap", "slide_cm_s": float("nan"), "windows": 0, "extra": "only here"},
]


def test_a_report_tells_how_it_was_made(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "report.json"
    report.write(path, ROWS, seed=7, command="goals")
    text = json.loads(path.read_text())
    assert text["rows"][0] == ROWS[0]
    assert text["rows"][1]["slide_cm_s"] is None, "NaN is not JSON"
    meta = text["meta"]
    assert meta["seed"] == 7 and meta["command"] == "goals"
    assert meta["date"].endswith("+00:00")
    assert meta["machine"]["cores"] >= 1 and meta["machine"]["cpu"]
    assert set(meta["versions"]) == {"wayfarer", "python", "numpy", "onnxruntime"}
    assert meta["metrics_version"] >= 1 and meta["commit"]


def test_outside_a_checkout_the_commit_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    assert report.meta({})["commit"] == "unknown"


def test_a_table_shows_every_figure_of_every_row(capsys: pytest.CaptureFixture[str]) -> None:
    with report.console.capture() as captured:
        report.show("title", ROWS)
    text = captured.get()
    for part in ("title", "model", "mocap", "slide_cm_s", "5.250", "–", "only here"):
        assert part in text


def test_a_bad_file_name_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    answer = CliRunner().invoke(app, ["long", "--json", str(tmp_path / "long.txt")])
    assert answer.exit_code == 2
    assert ".json" in answer.output


def test_recordings_are_judged_by_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "mocap.json"
    folder = write_recordings(tmp_path)
    answer = CliRunner().invoke(app, ["mocap", str(folder), "--json", str(path)])
    assert answer.exit_code == 0, answer.output
    rows = json.loads(path.read_text())["rows"]
    assert [row["name"] for row in rows] == [
        "mocap heldout", "mocap heldout, 0.9-1.4 m/s", "mocap heldout, standing",
    ]  # fmt: skip
    assert rows[1]["speed_mps"] == pytest.approx(SPEED, abs=1e-3)
