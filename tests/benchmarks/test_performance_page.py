"""The page that is made from records."""

import json
from pathlib import Path

import pytest

from benchmarks import bench, performance_page, performance_plots, record

META = {
    "quick": False,
    "date": "2030-01-02T03:04:05+00:00",
    "machine": {"cpu": "Some CPU", "cores": 2, "flags": ["avx512f"], "ram_gb": 16, "load": 0.1},
    "commit": "0123456789",
    "versions": {"wayfarer": "1"},
}


def part(rows, **more):
    return {"command": "python -m benchmarks.x", "rows": rows, "meta": META} | more


def test_rows_of_different_columns_become_tables_of_their_own():
    text = performance_page.section("transport", part([{"a": 1}, {"a": 2}, {"b": 0.12345}]))
    assert "| a |\n| --- |\n| 1 |\n| 2 |\n" in text
    assert "| b |\n| --- |\n| 0.123 |\n" in text


def test_a_section_says_where_its_figures_come_from():
    text = performance_page.section("step", part([{"a": 1}]))
    for word in ("benchmarks.x", "2030-01-02", "Some CPU", "2 cores", "avx512f", "0123456"):
        assert word in text
    assert "quick look" not in text


def test_a_quick_look_and_a_busy_machine_are_told():
    hasty = META | {"quick": True, "machine": META["machine"] | {"load": 7.0}}
    text = performance_page.section("step", part([{"a": 1}], meta=hasty))
    assert "quick look" in text and "load 7" in text


def test_a_benchmark_that_failed_says_so():
    text = performance_page.section("step", part([], failure="no such engine"))
    assert "It failed" in text and "no such engine" in text


def test_a_service_names_its_engine_and_search():
    assert performance_page.title("service_onnxruntime_k8").endswith("onnxruntime, K = 8")


def test_few_rows_of_many_columns_are_turned():
    text = performance_page.section("service_x_k1", part([{"agents": 5, "in_time": True}]))
    assert "| in_time | yes |" in text


STEP = {
    "rows": [
        {"engine": "e", "candidates": 1, "threads": t, "batch": b, "of_gemm": 2.0}
        for t in (1, 2)
        for b in (8, 64)
    ],
    "shares": [
        {"candidates": 1, "operators": "matrix products", "share": 0.6},
        {"candidates": 1, "operators": "copies", "share": 0.4},
    ],
}
TABLE = {
    "rows": [
        {"bodies": 64, "paper_s": 0.1, "one_call_s": 0.05, "best_calls_s": 0.04},
        {"bodies": 2048, "paper_s": None, "one_call_s": 1.0, "best_calls_s": 0.9},
    ]
}
MEMORY = {"rows": [{"agents": 0, "rss_mb": 100.0}, {"agents": 64, "rss_mb": 110.0}]}


@pytest.mark.parametrize(
    ("name", "found"), [("step", STEP), ("paper_s3", TABLE), ("memory", MEMORY)]
)
def test_pictures_are_drawn(tmp_path, name, found):
    assert performance_plots.draw(tmp_path, "x.png", name, found) == "x.png"
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")


def test_what_has_no_picture_or_no_rows_gets_none(tmp_path):
    assert performance_plots.draw(tmp_path, "x.png", "startup", MEMORY) is None
    assert performance_plots.draw(tmp_path, "x.png", "step", {"failure": "…"}) is None
    assert list(tmp_path.iterdir()) == []


def test_every_part_of_a_record_is_a_benchmark_with_a_title():
    folder = Path(record.__file__).parent
    for name in record.PARTS:
        module = record.command(name, quick=True)[2].removeprefix("benchmarks.")
        assert (folder / f"{module}.py").exists()
        assert performance_page.title(name) != name


def test_a_record_keeps_what_other_benchmarks_found(tmp_path, monkeypatch):
    monkeypatch.setattr(record, "PARTS", {"one": ("startup",), "two": ("startup",)})
    monkeypatch.setattr(
        record, "measured", lambda part, quick, agents: {"command": part, "rows": []}
    )
    for only in ("two", "one"):
        words = ["record", "--folder", str(tmp_path), "--name", "x", "--only", only]
        monkeypatch.setattr("sys.argv", words)
        assert record.main() == 0
    parts = json.loads((tmp_path / "performance_x.json").read_text())["parts"]
    assert list(parts) == ["one", "two"]
    assert parts["one"]["meta"]["machine"]["cores"] >= 1


def test_a_benchmark_that_fails_is_told_and_fails_the_record(tmp_path, monkeypatch):
    monkeypatch.setattr(record, "PARTS", {"one": ("no_such_benchmark",)})
    words = ["record", "--folder", str(tmp_path), "--name", "x", "--only", "one"]
    monkeypatch.setattr("sys.argv", words)
    assert record.main() == 1
    parts = json.loads((tmp_path / "performance_x.json").read_text())["parts"]
    assert "no_such_benchmark" in parts["one"]["failure"]


def test_the_shortest_call_is_kept_after_one_that_does_not_count():
    durations = iter([0.0, 9.0, 9.0 + 3.0, 20.0, 20.0 + 1.0, 30.0, 30.0 + 2.0])
    next(durations)
    calls = []
    assert bench.best(lambda: calls.append(1), 0.0, lambda: next(durations)) == 1.0
    assert len(calls) == 4
