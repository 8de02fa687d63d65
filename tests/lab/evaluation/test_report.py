"""Reports: the guarantees for readers of the JSON file."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from wayfarer.errors import FailedPrecondition
from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.commands import app
from wayfarer_lab.evaluation.gait import Row

ROWS: list[Row] = [
    {"name": "model", "slide_cm_s": 5.25, "windows": 3},
    {"name": "mocap", "slide_cm_s": float("nan"), "windows": 0, "extra": "only here"},
]


def test_a_report_tells_how_it_was_made(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "report.json"
    report.write(path, {"Gait": ROWS}, seed=7, command="goals")
    text = json.loads(path.read_text())
    assert text["rows"][0] == ROWS[0]
    assert text["rows"][1]["slide_cm_s"] is None, "NaN is not JSON"
    meta = text["meta"]
    assert meta["seed"] == 7 and meta["command"] == "goals"
    assert meta["date"].endswith("+00:00")
    assert meta["machine"]["cores"] >= 1 and meta["machine"]["cpu"]
    assert set(meta["versions"]) == {"wayfarer", "python", "numpy", "onnxruntime"}
    assert meta["metrics_version"] >= 1 and meta["commit"]


def test_the_same_tables_are_written_for_people(tmp_path: Path) -> None:
    report.write(tmp_path / "x.json", {"Gait": ROWS, "Nothing": []}, seed=7)
    page = (tmp_path / "x.md").read_text()
    assert page.startswith("# x\n") and "## Gait" in page and "Nothing" not in page
    assert "|  | model | mocap |\n| --- | --- | --- |\n| slide_cm_s | 5.250 | – |" in page
    assert "- seed: 7" in page


def test_many_rows_of_few_figures_run_down_the_page(tmp_path: Path) -> None:
    rows: list[Row] = [{"name": f"row {i}", "slide_cm_s": float(i)} for i in range(5)]
    page = report.markdown("x", {"Gait": rows}, report.meta({}))
    assert "|  | slide_cm_s |\n| --- | --- |\n| row 0 | 0.000 |\n| row 1 | 1.000 |" in page


def test_outside_a_checkout_the_commit_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    assert report.meta({})["commit"] == "unknown"
    with pytest.raises(FailedPrecondition, match="checkout"):
        report.check_origin()


def test_an_installed_package_is_its_release(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(report, "__file__", "/venv/site-packages/wayfarer_lab/report.py")
    assert report.commit().startswith("release ")
    report.check_origin()


def test_a_table_shows_every_figure_of_every_row(capsys: pytest.CaptureFixture[str]) -> None:
    with report.console.capture() as captured:
        report.show("title", ROWS)
    text = captured.get()
    for part in ("title", "model", "mocap", "slide_cm_s", "5.250", "–", "only here"):
        assert part in text


def test_a_bad_file_name_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    answer = CliRunner().invoke(app, ["skating", "--json", str(tmp_path / "skating.txt")])
    assert answer.exit_code == 2
    assert ".json" in answer.output
