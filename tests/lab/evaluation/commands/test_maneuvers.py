"""`wayfarer eval maneuvers` on the command line, with an engine that glides."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from tests.lab.evaluation.commands.conftest import Evaluate
from tests.lab.evaluation.people import ANNY, gliding_bundle
from tests.lab.evaluation.recordings import write_recordings
from wayfarer.spec import GENDERS
from wayfarer_lab.evaluation.commands import app, maneuvers
from wayfarer_lab.evaluation.maneuvers.maneuver import MeasuredTake
from wayfarer_lab.evaluation.twosided.served import SERVED

QUICK = ("maneuvers", "--quick")


@pytest.fixture(autouse=True)
def gliding(monkeypatch: pytest.MonkeyPatch) -> None:
    bundle = gliding_bundle(ANNY, "policy.onnx")
    monkeypatch.setattr(maneuvers, "open_bundle", lambda models, threads, engine: bundle)
    monkeypatch.setattr(maneuvers, "QUICK", 0.03)


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, [*QUICK, *arguments])


def test_who_glides_upright_keeps_posture_and_lifts_no_foot(evaluate: Evaluate) -> None:
    made = evaluate(*QUICK, "--only", "strafe")
    rows = {(row["case"], row["source"]): row for row in made["rows"]}
    for side in ("left", "right", "back"):
        sent, raw = rows[side, "sent"], rows[side, "raw"]
        assert raw["hips_p5"] == pytest.approx(1.0, abs=0.02)
        assert raw["lifts_per_04_m"] == raw["float_share"] == raw["contact_up"] == 0
        assert sent["arrive"] == 1 and sent["lifts_per_04_m"] == 0, "no rule makes steps of it"
    verdicts = {(bar["case"], bar["figure"]): bar["verdict"] for bar in made["bars"]}
    assert verdicts["left", "hips_p5"] == "met"
    assert ("left against right", "left_right_points") in verdicts


def test_rows_say_whose_they_are_and_every_take_has_its_figures(evaluate: Evaluate) -> None:
    made = evaluate(*QUICK, "--only", "stop", "--seed", "5")
    assert [(row["case"], row["source"]) for row in made["rows"]] == [
        ("at a goal", "sent"), ("at a goal", "raw"),
        ("facing asked", "sent"), ("facing asked", "raw"),
    ]  # fmt: skip
    assert [row["n"] for row in made["rows"]] == [3, 3, 2, 2]
    assert len(made["each"]) == 10
    asked = [take["off_heading_deg"] is not None for take in made["each"]]
    assert asked == [take["case"] == "facing asked" for take in made["each"]]
    assert {"apart_cm", "heel_up", "rest_s"} <= set(made["each"][0])
    assert {take["gender"] for take in made["each"]} == set(GENDERS)
    assert made["meta"]["seed"] == 5 and made["meta"]["quick"] is True


def test_two_sided_figures_come_without_a_manoeuvre(
    evaluate: Evaluate, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(maneuvers, "compare", partial(maneuvers.compare, served=SERVED[1:2]))
    made = evaluate(*QUICK, "--only", "two-sided", "--seeds", "1")
    assert not made["rows"] and not made["bars"]
    assert [side["source"] for side in made["two_sided"]] == ["sent", "raw"]
    for side in made["two_sided"]:
        assert 0 <= side["holds"] < 0.3 * side["of"], "a glider is no person"
        assert {p["situation"] for p in side["people"]} == {"walk 1.0"}
    assert made["two_sided"][0]["repair"]["all rules"]["cm_p95"] > 0


def test_a_missed_bar_fails_only_with_check() -> None:
    assert run("--only", "likeness").exit_code == 0
    assert run("--only", "likeness", "--check").exit_code == 1, (
        "without recordings nothing is alike"
    )


def test_what_is_not_there_is_refused_before_anything_is_played(tmp_path: Path) -> None:
    answer = run("--only", "strafe,moonwalk")
    assert answer.exit_code == 2 and "moonwalk" in answer.output and "stand" in answer.output
    answer = run("--json", str(tmp_path / "table.csv"))
    assert answer.exit_code == 2 and ".json" in answer.output


def test_an_interrupt_leaves_what_is_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(shot: MeasuredTake) -> dict[str, float]:
        raise KeyboardInterrupt

    strafe = replace(maneuvers.MANEUVERS["strafe"], measure=stop)
    monkeypatch.setitem(maneuvers.MANEUVERS, "strafe", strafe)
    path = tmp_path / "both.json"
    assert run("--only", "turn,strafe", "--json", str(path)).exit_code != 0
    assert {row["maneuver"] for row in json.loads(path.read_text())["rows"]} == {"turn"}


def test_recordings_stand_beside(tmp_path: Path, evaluate: Evaluate) -> None:
    data = write_recordings(tmp_path, "heldout", "train")
    made = evaluate(*QUICK, "--only", "likeness", "--data", str(data))
    rows = {r["source"]: r for r in made["rows"] if r["case"] == "straight walks"}
    assert list(rows) == ["sent", "raw", "recorded", "recorded, held out"]
    assert rows["recorded"]["n"] == 2 and rows["recorded, held out"]["n"] == 1
    people = {take["person"] for take in made["each"] if take["source"] == "recorded"}
    assert people == {"07"}
