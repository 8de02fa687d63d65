"""`wayfarer eval control` on the command line, with an engine that glides."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.lab.evaluation.commands.conftest import Evaluate
from tests.lab.evaluation.people import BODIES, gliding_bundle
from tests.lab.evaluation.recordings import write_recordings
from wayfarer.models.bundle import ModelBundle
from wayfarer_lab.evaluation.commands import app, control


def made_bundle(path: Path, threads: int) -> ModelBundle:
    """Gliding models; those in a folder called `plain` have no policy."""
    return gliding_bundle(BODIES, *([] if path.name == "plain" else ["policy.onnx"]))


@pytest.fixture(autouse=True)
def gliding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control, "open_bundle", made_bundle)


def test_control_has_a_method_for_each_row_of_the_paper() -> None:
    papers = {"policy(10)": None, "policy(1)": Path("other")}
    methods = control.methods(made_bundle(Path("shipped"), 0), papers, Path("plain"), 1, 0, 0)
    assert [method.name for method in methods] == [
        "g-CVAE", "policy", "policy(1)", "policy & top1", "policy(1) & top1",
        "policy & top4", "policy(1) & top4", "N(0, I) & top1",
        "search K=8 N(0, I)", "search K=8 π", "search K=4 π", "search K=1 π",
        "search K=8 π, foot lock",
    ]  # fmt: skip


@pytest.mark.parametrize("only", ["g-CVAE", "policy(1) & top4", "search K=8 π"])
def test_rows_of_control_have_the_papers_figures(
    only: str, tmp_path: Path, evaluate: Evaluate
) -> None:
    rows = evaluate(
        "control", "--pairs", "1", "--g-cvae", str(tmp_path / "plain"), "--only", only,
        "--policy-1", str(tmp_path / "other"), "--data", str(write_recordings(tmp_path)),
    )["rows"]  # fmt: skip
    for row in rows[:-1]:
        assert {"success", "steps", "avg_dist", "contact"} <= set(row)
        assert row["success"] == 1.0 and row["steps"] > 0 and row["avg_dist"] >= 0
    assert rows[-1]["success"] is None and rows[-1]["walk_slide_cm_s"] > 100, "gliders, too"


def test_models_without_a_policy_have_no_rows_of_one(tmp_path: Path, evaluate: Evaluate) -> None:
    rows = evaluate("control", "--pairs", "1", "--models", str(tmp_path / "plain"))["rows"]
    assert [row["name"] for row in rows] == ["N(0, I) & top1", "search K=8 N(0, I)"]
    answer = CliRunner().invoke(app, ["control", "--policy-1", str(tmp_path / "plain")])
    assert answer.exit_code != 0 and "policy.onnx" in str(answer.exception)


def test_some_methods_alone_are_measured_when_asked_for(evaluate: Evaluate) -> None:
    rows = evaluate("control", "--pairs", "1", "--only", "policy & top")["rows"]
    assert [row["name"] for row in rows] == ["policy & top1", "policy & top4"]
    answer = CliRunner().invoke(app, ["control", "--only", "walk"])
    assert answer.exit_code != 0 and "no method begins with 'walk'; there are: policy," in str(
        answer.exception
    )
