"""`wayfarer eval scenes` on the command line, with an engine that glides."""

from pathlib import Path

import pytest
from PIL import Image
from typer.testing import CliRunner

from tests.lab.evaluation.commands.conftest import Evaluate
from tests.lab.evaluation.people import ANNY, gliding_bundle
from wayfarer_lab.evaluation.commands import app, scenes
from wayfarer_lab.evaluation.scenes.scenarios import changes


@pytest.fixture(autouse=True)
def gliding(monkeypatch: pytest.MonkeyPatch) -> None:
    bundle = gliding_bundle(ANNY, "policy.onnx")
    monkeypatch.setattr(scenes, "open_bundle", lambda models, threads, engine: bundle)


def test_cubes_have_the_issues_figures_and_a_picture(tmp_path: Path, evaluate: Evaluate) -> None:
    made = evaluate(
        "scenes", "--only", "cubes", "--scale", "0.05", "--pictures", str(tmp_path / "pictures")
    )
    [row] = made["rows"]
    assert {"success", "penetration_frames", "path_ratio"} <= set(row)
    assert row["agents"] == 5 and row["success"] == 1.0
    assert 1.0 <= row["path_ratio"] <= row["path_ratio_max"] < 1.1
    assert row["walked_ratio"] == pytest.approx(1.0, abs=0.1), "gliders keep to their way"
    assert row["agent_frames"] > 0 and row["stuck_agents"] == 0
    assert 0 < row["engine_share"] + row["navigation_share"] + row["avoidance_share"] < 1
    assert set(made["meta"]["worst"]) == {"cubes"} and made["meta"]["seed"] == 0
    assert max(Image.open(tmp_path / "pictures" / "cubes.png").size) == 720


def test_people_climb_and_see_doors_shut_and_crates_fall(
    evaluate: Evaluate, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(changes, "LIMIT", 28.0)  # longer than any way here takes
    rows = evaluate("scenes", "--only", "slope,doors,crates", "--scale", "0.05")["rows"]
    slope, doors, crates = rows
    assert [row["name"] for row in rows] == ["slope", "doors", "crates"]
    assert slope["success"] == 1.0 and slope["penetration_frames"] < 0.05
    assert doors["success"] == 1.0 and doors["agents"] == 1
    assert 0 <= doors["shut_felt_s_max"] <= 0.5 and 0 <= doors["open_felt_s_max"] <= 1.5
    assert crates["success"] == 1.0 and crates["crate_felt_s_mean"] <= 0.5


def test_two_streams_meet_in_the_corridor_and_wanderers_in_the_square(evaluate: Evaluate) -> None:
    rows = evaluate("scenes", "--only", "corridor,square", "--scale", "0.03", "--minutes", "0.3")[
        "rows"
    ]
    corridor, square = rows
    assert corridor["agents"] == 2 and corridor["success"] == 1.0
    assert corridor["seconds_last"] >= corridor["seconds_median"] > 10
    assert square["agents"] == 6 and square["goals_per_minute_each"] > 0
    assert 0 <= square["overlap_frames"] < 1


def test_a_door_is_shared_and_runs_are_repeated_with_other_seeds(evaluate: Evaluate) -> None:
    made = evaluate("scenes", "--only", "doorway", "--scale", "0.25", "--repeats", "2")
    assert [row["name"] for row in made["rows"]] == ["doorway, seed 0", "doorway, seed 1"]
    assert all(row["agents"] == 4 and row["success"] == 1.0 for row in made["rows"])
    assert made["rows"][0]["agent_frames"] != made["rows"][1]["agent_frames"]
    assert set(made["meta"]["worst"]) == {"doorway, seed 0", "doorway, seed 1"}


def test_unknown_scenarios_are_refused_with_those_there_are() -> None:
    answer = CliRunner().invoke(app, ["scenes", "--only", "cubes,moon"])
    assert answer.exit_code == 2 and "moon" in answer.output
