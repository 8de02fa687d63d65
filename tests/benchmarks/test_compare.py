"""The regression check: ratios of two records."""

import json

import pytest

from benchmarks import compare


def record(**values):
    ratios = {name: {"value": v, "better": "lower"} for name, v in values.items()}
    return {"parts": {"step": {"rows": [], "ratios": ratios}}}


def verdicts(before, after, tolerance=0.1):
    found = compare.changes(compare.ratios(before), compare.ratios(after), tolerance)
    return {change.name: change.verdict for change in found}


@pytest.mark.parametrize(
    ("after", "verdict"), [(2.0, "same"), (2.19, "same"), (2.3, "worse"), (1.7, "better")]
)
def test_lower_is_better_where_it_is_said(after, verdict):
    assert verdicts(record(cost=2.0), record(cost=after)) == {"cost": verdict}


def test_higher_is_better_where_it_is_said():
    before, after = record(share=0.8), record(share=0.5)
    for document in (before, after):
        document["parts"]["step"]["ratios"]["share"]["better"] = "higher"
    assert verdicts(before, after) == {"share": "worse"}
    assert verdicts(after, before) == {"share": "better"}


def test_a_ratio_that_is_gone_is_a_fault_if_its_benchmark_was_run():
    assert verdicts(record(a=1.0, b=1.0), record(a=1.0)) == {"a": "same", "b": "gone"}
    assert verdicts(record(a=1.0), {"parts": {}}) == {"a": "not measured"}
    assert verdicts(record(), record(a=1.0)) == {"a": "new"}


def run(monkeypatch, tmp_path, before, after):
    paths = [tmp_path / "before.json", tmp_path / "after.json"]
    for path, document in zip(paths, (before, after), strict=True):
        path.write_text(json.dumps(document))
    monkeypatch.setattr("sys.argv", ["compare", *map(str, paths)])
    return compare.main()


def test_it_ends_with_1_only_when_something_is_worse(monkeypatch, tmp_path, capsys):
    assert run(monkeypatch, tmp_path, record(cost=2.0), record(cost=2.0)) == 0
    assert run(monkeypatch, tmp_path, record(cost=2.0), record(cost=3.0)) == 1
    told = capsys.readouterr().out
    assert "worse" in told and "+50%" in told


def test_files_of_a_single_benchmark_can_be_compared(monkeypatch, tmp_path):
    single = record(cost=2.0)["parts"]["step"]
    worse = record(cost=3.0)["parts"]["step"]
    assert run(monkeypatch, tmp_path, single, worse) == 1


def test_nothing_to_compare_is_not_a_success(monkeypatch, tmp_path, capsys):
    assert run(monkeypatch, tmp_path, {"parts": {}}, {"parts": {}}) == 1
    assert "no ratios" in capsys.readouterr().out
