"""`wayfarer eval realism`, `bodies`, `skating` from the command line, with fakes for networks."""

from pathlib import Path

import pytest
from PIL import Image
from typer.testing import CliRunner

from tests.lab.evaluation.commands.conftest import Evaluate
from tests.lab.evaluation.fakes import known_parts
from tests.lab.evaluation.recordings import SPEED, write_recordings
from tests.lab.evaluation.test_direct import Circle
from wayfarer.errors import DataError, InvalidArgument
from wayfarer_lab.evaluation import model_parts, random_motion
from wayfarer_lab.evaluation.commands import app
from wayfarer_lab.evaluation.commands.paper import draw_figures
from wayfarer_lab.evaluation.direct import CAPTION, CELL
from wayfarer_lab.evaluation.model_parts import Direct
from wayfarer_lab.training.representation import BodyParameters

SMALL = {
    "realism": ["--poses", "4", "--seconds", "1.2"],
    "bodies": ["--futures", "1", "--seconds", "1.2"],
    "skating": ["--poses", "4", "--primitives", "6"],
}


@pytest.fixture(autouse=True)
def fakes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(model_parts, "load_parts", lambda *asked: known_parts(policy=None))
    monkeypatch.setattr(random_motion, "SHAPES", 2)


@pytest.mark.parametrize("table", SMALL)
def test_a_table_is_written_with_its_row_of_mocap(
    table: str, tmp_path: Path, evaluate: Evaluate
) -> None:
    data = write_recordings(tmp_path, "train", "heldout")
    text = evaluate(table, "--data", str(data), "--seed", "3", *SMALL[table])
    rows = {row["name"]: row for row in text["rows"]}
    assert rows["mocap"]["speed_mps"] == pytest.approx(SPEED, abs=1e-3)
    assert text["meta"]["seed"] == 3 and text["meta"]["split"] == "heldout"
    assert "| mocap |" in (tmp_path / "out/table.md").read_text()
    if table == "realism":
        assert rows["mocap"]["frechet_v1"] is None, "two windows make no distribution"
        assert rows["mocap"]["frechet_windows"] == 2


def test_without_data_there_is_no_row_of_mocap(evaluate: Evaluate) -> None:
    text = evaluate("skating", *SMALL["skating"])
    assert [row["name"] for row in text["rows"]] == ["ro-1f", "ro-2f"]
    assert text["meta"]["data"] is None and text["meta"]["split"] is None


def test_only_the_rows_that_are_asked_for_are_made(evaluate: Evaluate) -> None:
    rows = evaluate("realism", "--only", "ro-pred-2f,ro-1f", *SMALL["realism"])["rows"]
    assert [row["name"] for row in rows[:2]] == ["ro-pred-2f", "ro-1f"] and len(rows) == 4
    answer = CliRunner().invoke(app, ["realism", "--only", "3f", *SMALL["realism"]])
    assert isinstance(answer.exception, InvalidArgument) and "'3f'" in str(answer.exception)


def test_failures_are_found_and_drawn_beside_what_markers_do(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    direct = {"direct-body": Direct(Circle(), BodyParameters(), True)}
    monkeypatch.setattr(model_parts, "load_parts", lambda *asked: known_parts(direct=direct))
    path = tmp_path / "failures.json"
    size = ["--poses", "2", "--seconds", "1.2", "--count", "1", "--runs", str(tmp_path)]
    answer = CliRunner().invoke(app, ["failures", *size, "--json", str(path)])
    assert answer.exit_code == 0, answer.output
    assert "direct-body, markers, ro-2f" in answer.output
    assert draw_figures(path, tmp_path) == {"fig_s3": "paper_fig_s3.png"}
    assert Image.open(tmp_path / "paper_fig_s3.png").size == (CELL[0], 2 * (CAPTION + CELL[1]))


@pytest.mark.parametrize("table", SMALL)
def test_unfit_data_are_refused(table: str, tmp_path: Path) -> None:
    answer = CliRunner().invoke(app, [table, "--data", str(tmp_path)])
    assert isinstance(answer.exception, DataError)
    assert "wayfarer data prepare" in str(answer.exception)


def test_a_split_that_does_not_exist_is_named_with_those_that_do(tmp_path: Path) -> None:
    data = write_recordings(tmp_path)
    answer = CliRunner().invoke(app, ["skating", "--data", str(data), "--split", "hidden"])
    assert isinstance(answer.exception, InvalidArgument)
    assert "'hidden'" in str(answer.exception) and "['heldout']" in str(answer.exception)
