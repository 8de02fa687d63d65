"""`wayfarer eval mocap`, `predictor`, `regressor` from the command line."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.lab.evaluation.fakes import known_parts
from tests.lab.evaluation.recordings import SPEED, write_recordings
from wayfarer_lab.evaluation import models, parts
from wayfarer_lab.evaluation.commands import app


def test_recordings_are_judged_by_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "mocap.json"
    folder = write_recordings(tmp_path)
    answer = CliRunner().invoke(app, ["mocap", "--data", str(folder), "--json", str(path)])
    assert answer.exit_code == 0, answer.output
    rows = json.loads(path.read_text())["rows"]
    assert [row["name"] for row in rows] == ["mocap heldout", "mocap heldout, 0.9-1.4 m/s"]
    assert rows[1]["speed_mps"] == pytest.approx(SPEED, abs=1e-3)


@pytest.mark.parametrize("table", ["predictor", "regressor"])
def test_networks_are_judged_on_recordings(
    table: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parts, "load_parts", lambda *asked: known_parts())
    monkeypatch.setattr(models, "MESH_FRAMES", 2)
    path = tmp_path / f"{table}.json"
    data = write_recordings(tmp_path, "train", "heldout")
    answer = CliRunner().invoke(
        app, [table, "--data", str(data), "--count", "5", "--json", str(path)]
    )
    assert answer.exit_code == 0, answer.output
    text = json.loads(path.read_text())
    assert "mocap" in [row["name"] for row in text["rows"]]
    assert text["meta"]["data"] == str(data)
    assert path.with_suffix(".md").exists()


@pytest.mark.parametrize("table", ["mocap", "predictor", "regressor"])
def test_recordings_must_be_given(table: str) -> None:
    answer = CliRunner().invoke(app, [table])
    assert answer.exit_code == 2 and "--data" in answer.output
