"""The page paper.md and its statements, from results of these tests and from shipped ones."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from wayfarer.errors import DataError
from wayfarer_lab.evaluation.commands import app
from wayfarer_lab.evaluation.commands.paper import runtime
from wayfarer_lab.evaluation.paper.orderings import ORDERINGS, Ordering, against_mojo, state
from wayfarer_lab.evaluation.paper.page import page
from wayfarer_lab.evaluation.paper.published import EXHIBITS
from wayfarer_lab.evaluation.paper.results import ResultsFolder, Source

ROOT = Path(__file__).resolve().parents[4]
META = {
    "seed": 7,
    "split": "heldout",
    "commit": "0123456789",
    "date": "2026-11-23T10:00:00+00:00",
    "machine": {"cpu": "EPYC", "cores": 2},
    "command": "wayfarer eval control --pairs 3",
    "cpu_minutes": {"policy": 41.6, "predictor_2f": None},
    "steps": {"policy": "500 × 64"},
}


def write(folder: Path, name: str, *rows: dict[str, Any], **meta: Any) -> None:
    text = json.dumps({"rows": rows, "meta": META | meta})
    (folder / f"{name}.json").write_text(text)


def order(more: bool = True) -> Ordering:
    one, other = Source("policy & top1", ("control*",)), Source("policy", ("control*",))
    return Ordering("search helps", "Table 1", one, other, "success", more, "nobody ran it")


@pytest.mark.parametrize(
    ("one", "other", "more", "verdict"),
    [
        ([0.9], [0.8], True, "as in the paper"),
        ([0.9], [0.8], False, "the other way"),
        ([0.9, 0.95, 0.92], [0.8, 0.7, 0.89], True, "as in the paper"),
        ([0.9, 0.95, 0.92], [0.8, 0.7, 0.91], True, "within the spread"),
        ([0.9], [0.9], True, "no difference"),
        ([0.5, 0.6], [0.7, 0.8], True, "the other way"),
    ],
)
def test_an_order_holds_only_beyond_the_spread_of_trainings(tmp_path, one, other, more, verdict):
    for seed, values in enumerate(zip(one, other, strict=True)):
        names = ("policy & top1", "policy")
        rows = [{"name": n, "success": v} for n, v in zip(names, values, strict=True)]
        write(tmp_path, f"control_seed_{seed}", *rows)
    said = state(order(more), ResultsFolder(tmp_path))
    assert said.verdict == verdict
    assert ("one training each" in said.figures) == (len(one) == 1)


def test_what_is_not_measured_is_told_with_its_reason(tmp_path):
    write(tmp_path, "control", {"name": "policy", "success": 1.0})
    assert state(order(), ResultsFolder(tmp_path)).verdict == "not measured"
    assert state(order(), ResultsFolder(tmp_path)).figures == "nobody ran it"
    write(tmp_path, "control", {"name": "policy", "success": 1.0}, {"name": "policy & top1"})
    assert state(order(), ResultsFolder(tmp_path)).verdict == "not measured"


def test_rows_tell_what_made_them_and_trainings_their_range(tmp_path):
    for seed, success in enumerate((0.9, 0.8, 1.0)):
        row = {"name": "policy(10)", "success": success, "steps": None}
        write(tmp_path, f"control_paper_{seed}", row, seed=seed)
    write(tmp_path, "control", {"name": "policy(10)", "success": 0.1})
    made = page(ResultsFolder(tmp_path), "here", {64: 0.01})
    (line,) = (line for line in made.splitlines() if line.startswith("| policy(10) |"))
    assert "| 33.9 |" in line and "| 0.95 | 0.9 (0.8…1) |" in line, "the paper's runs come first"
    assert "`wayfarer eval control --pairs 3`, seed 2, split heldout, commit 0123456" in made
    told = "Minutes of training (steps × batch): policy 42 (500 × 64), predictor_2f not counted"
    assert told in made
    assert "**policy(10)** is missing" not in made and "**policy(1)** is missing" in made
    assert "| 64 | 0.1 | 0.01 |" in made and "| 128 | 0.15 | – |" in made


def test_no_row_is_missing_without_a_reason(tmp_path):
    """With a result that has no row of the paper's, each row states why it is missing."""
    write(tmp_path, "nothing", {"name": "nothing"})
    made = page(ResultsFolder(tmp_path), "here", None)
    for exhibit in EXHIBITS:
        for line in exhibit.lines:
            assert line.source or line.why, line.name
            assert not line.why or f"**{line.name}** is missing: {line.why}." in made
    assert made.count("**not measured**") == len(ORDERINGS)
    assert "No result" in against_mojo(ResultsFolder(tmp_path))


def test_a_folder_without_results_is_refused(tmp_path):
    with pytest.raises(DataError, match="holds no result"):
        ResultsFolder(tmp_path)
    (tmp_path / "control.json").write_text("{")
    with pytest.raises(DataError, match=r"control\.json"):
        ResultsFolder(tmp_path)
    (tmp_path / "performance_x.json").write_text('{"parts": {}}')
    with pytest.raises(DataError, match="no Table S3"):
        runtime(tmp_path)


def test_the_page_that_ships_is_made_from_the_results_beside_it(tmp_path, monkeypatch):
    results = ROOT / "benchmarks" / "results"
    if not results.exists():
        pytest.skip("an installed package has no results")
    monkeypatch.chdir(ROOT)
    out = tmp_path / "paper.md"
    answer = CliRunner().invoke(app, ["paper", "--out", str(out)])
    assert answer.exit_code == 0, answer.output
    shown = (ROOT / "benchmarks" / "results" / "paper.md").read_text(encoding="utf-8")
    assert shown == out.read_text(encoding="utf-8"), "run: wayfarer eval paper"


def test_the_orders_that_ship_are_those_that_docs_state():
    """This includes disagreements with the paper: a change of a result changes this list."""
    results = ROOT / "benchmarks" / "results"
    if not results.exists():
        pytest.skip("an installed package has no results")
    stated = {o.claim: state(o, ResultsFolder(results)).verdict for o in ORDERINGS}
    for what in (
        "makes the 2-frame predictor more diverse",
        "costs the 2-frame predictor some",
        "more diverse than 2-frame models, without",
        "less accurate than 2-frame models, without",
        "less continuous than 2-frame models, without",
    ):
        (claim,) = (c for c in stated if what in c and not c.endswith("short trainings"))
        assert stated[claim] == "as in the paper"
    assert stated["tree search leaves bodies nearer to the goal: PPO"] == "as in the paper"
    assert stated["of all variants the policy has the best contact"] == "the other way"
    assert stated["feet skate no more than in recordings"] == "the other way"
    assert stated["motion of the policy looks more real than random motion"] == "the other way"
    assert stated["body shape matters less than the start pose: spread of steps"] == "the other way"
