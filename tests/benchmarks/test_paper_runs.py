"""Trainings behind docs/paper.md: what they are trained with, which rows they stand for."""

import json
from argparse import Namespace
from pathlib import Path

import pytest
from benchmarks.paper_runs import GROUPS, is_finished, measure, rows, settings

from benchmarks import paper_runs
from wayfarer_lab.evaluation.paper.published import EXHIBITS

ASKED = Namespace(steps=50, rollout_steps=20, batch=None)


def write_run(folder: Path, steps: int, wanted: int) -> None:
    folder.mkdir(parents=True)
    (folder / "config.json").write_text(json.dumps({"steps": wanted}))
    (folder / "effort.json").write_text(json.dumps({"steps": steps, "cpu_minutes": 1.0}))


@pytest.mark.parametrize("group", GROUPS)
def test_every_run_has_a_config_and_starts_from_one_before_it(group, tmp_path) -> None:
    known = [str(tmp_path / group / name) for name in GROUPS[group].runs]
    for number, name in enumerate(GROUPS[group].runs):
        made = settings(name, tmp_path, group, ASKED)
        assert made.steps == (20 if name.endswith("_rollout") else 50)
        assert made.batch > 100, "the config's"
        if group in ("predictors", "direct") and made.start_from:
            assert made.start_from in known[:number]
    if group == "end_to_end":
        assert made.start_from == str(tmp_path / "predictors" / "predictor_2f_rollout")


def test_rows_on_the_page_are_those_that_are_measured() -> None:
    """Each row that the page wants from these files is made, once everything is trained."""
    wanted = {
        (line.source.files[0].rstrip("*"), line.source.name)
        for exhibit in EXHIBITS
        for line in exhibit.lines
        if line.source
    }
    for group in ("predictors", "direct", "end_to_end"):
        made = rows(group, GROUPS[group].runs)
        file = GROUPS[group].tables["realism"]
        assert {name for stem, name in wanted if stem == file} <= set(made), group


def test_only_finished_runs_are_measured(tmp_path, monkeypatch, capsys) -> None:
    calls: list[list[str]] = []
    monkeypatch.setattr(paper_runs.subprocess, "run", lambda words, check: calls.append(words))
    folder = tmp_path / "predictors"
    write_run(folder / "predictor_2f", 50, 50)
    write_run(folder / "predictor_2f_rollout", 3, 50)
    assert is_finished(folder / "predictor_2f") and not is_finished(folder / "predictor_1f")
    measure("predictors", tmp_path, tmp_path, 10)
    predictor, realism = calls
    assert predictor[:3] == ["wayfarer", "eval", "predictor"]
    assert predictor[predictor.index("--only") + 1] == "2f"
    assert realism[realism.index("--only") + 1] == "2f,reproj-2f"
    assert realism[realism.index("--json") + 1].endswith("benchmarks/results/realism_paper.json")
    measure("direct", tmp_path, tmp_path, 10)
    assert len(calls) == 2 and "nothing is finished" in capsys.readouterr().out
