"""Trainings behind results/paper.md: their settings, and the rows that they stand for."""

import json
from argparse import Namespace
from pathlib import Path

import pytest
from benchmarks.paper_runs import GROUPS, PREDICTORS, is_finished, measure, rows, settings

from benchmarks import paper_runs
from wayfarer_lab.evaluation.paper.published import EXHIBITS

ASKED = Namespace(steps=50, rollout_steps=20, batch=None, seed=0)


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
        if group in ("predictors", "short", "direct") and made.start_from:
            assert made.start_from in known[:number]
    if group == "end_to_end":
        assert made.start_from == str(tmp_path / "predictors" / "predictor_2f_rollout")


def test_seeds_and_short_trainings_are_kept_apart(tmp_path) -> None:
    nothing = Namespace(steps=None, rollout_steps=None, batch=None, seed=2)
    first, then = (settings(name, tmp_path, "short", nothing) for name in PREDICTORS[:2])
    assert (first.seed, first.steps, first.batch) == (2, 1000, 256)
    assert (then.seed, then.steps, then.batch) == (2, 200, 256)
    assert then.start_from == str(tmp_path / "short_seed_2" / "predictor_2f")
    together = settings("end_to_end", tmp_path, "end_to_end", nothing)
    assert together.start_from == str(tmp_path / "predictors_seed_2" / "predictor_2f_rollout")
    assert settings("predictor_2f", tmp_path, "predictors", nothing).steps > 1000, "the config's"


def test_groups_differ_in_what_they_compare_alone(tmp_path) -> None:
    asked = Namespace(steps=None, rollout_steps=None, batch=None, seed=0)
    short = settings("predictor_2f", tmp_path, "short", asked).model_dump()
    for weight in (0.05, 0.2, 1.0):
        made = settings("predictor_2f", tmp_path, f"kl_{weight:g}", asked).model_dump()
        assert made == short | {"kl_weight": weight}
    through, apart = (
        settings("regressor_male", tmp_path, group, asked).model_dump()
        for group in ("regressors", "regressors_apart")
    )
    assert through["through"] and apart == through | {"through": False}


def test_rows_on_the_page_are_those_that_are_measured() -> None:
    """Each row that the page needs from these files is made after all trainings."""
    wanted = {
        (line.source.files[0].rstrip("*"), line.source.name)
        for exhibit in EXHIBITS
        for line in exhibit.lines
        if line.source
    }
    for group in ("predictors", "short", "direct", "end_to_end"):
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
    write_run(tmp_path / "short_seed_1" / "predictor_1f", 50, 50)
    measure("short", tmp_path, tmp_path, 10, seed=1)
    files = [words[words.index("--json") + 1] for words in calls[2:]]
    assert [Path(file).stem for file in files] == ["predictor_short_seed_1", "realism_short_seed_1"]
    calls[2:] = []
    measure("direct", tmp_path, tmp_path, 10)
    assert len(calls) == 2 and "nothing is finished" in capsys.readouterr().out
