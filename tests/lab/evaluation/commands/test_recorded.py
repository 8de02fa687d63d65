"""`wayfarer eval mocap`, `predictor`, `regressor` from the command line."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.lab.evaluation.commands.conftest import Evaluate
from tests.lab.evaluation.fakes import known_parts
from tests.lab.evaluation.recordings import SPEED, write_recordings
from wayfarer_lab.evaluation import model_parts, models
from wayfarer_lab.evaluation.commands import app


def test_recordings_are_judged_by_the_command_line(tmp_path: Path, evaluate: Evaluate) -> None:
    rows = evaluate("mocap", "--data", str(write_recordings(tmp_path)))["rows"]
    assert [row["name"] for row in rows] == ["mocap heldout", "mocap heldout, 0.9-1.4 m/s"]
    assert rows[1]["speed_mps"] == pytest.approx(SPEED, abs=1e-3)


@pytest.mark.parametrize("table", ["predictor", "regressor"])
def test_networks_are_judged_on_recordings(
    table: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, evaluate: Evaluate
) -> None:
    monkeypatch.setattr(model_parts, "load_parts", lambda *asked: known_parts())
    monkeypatch.setattr(models, "MESH_FRAMES", 2)
    data = write_recordings(tmp_path, "train", "heldout")
    text = evaluate(table, "--data", str(data), "--count", "5")
    assert "mocap" in [row["name"] for row in text["rows"]]
    assert text["meta"]["data"] == str(data)
    assert (tmp_path / "out/table.md").exists()


@pytest.mark.parametrize("table", ["mocap", "predictor", "regressor"])
def test_recordings_must_be_given(table: str) -> None:
    answer = CliRunner().invoke(app, [table])
    assert answer.exit_code == 2 and "--data" in answer.output
