"""`wayfarer load` against a server that it starts itself: real processes, real streams."""

import json

import pytest
from typer.testing import CliRunner

from wayfarer.cli import app


@pytest.mark.parametrize(("transport", "workers"), [("grpc", "1"), ("websocket", "2")])
def test_a_run_measures_a_server_of_its_own(tmp_path, monkeypatch, transport, workers):
    monkeypatch.setenv("WAYFARER_ADMISSION", "false")  # a busy test machine shall refuse nobody
    monkeypatch.setenv("WAYFARER_CANDIDATES", "1")
    monkeypatch.setenv("WAYFARER_WORKERS", workers)
    monkeypatch.setenv("WAYFARER_ENGINE", "onnxruntime")
    path = tmp_path / "run.json"
    options = {
        "sessions": 2,
        "agents": 2,
        "seconds": 2,
        "warm-up": 1,
        "goal-rate": 2,
        "slow": 1,
        "vanishing": 1,
        "transport": transport,
        "json": path,
    }
    words = [word for name, value in options.items() for word in (f"--{name}", str(value))]
    result = CliRunner().invoke(app, ["load", *words])
    assert result.exit_code == 0, result.output
    found = json.loads(path.read_text())
    assert found["agents"] == 4 and found["refused"] == 0
    assert found["chunks"] > 10
    assert found["lateness_ms"]["max"] >= found["lateness_ms"]["p50"] >= 0
    assert found["first_chunk_ms"] and found["goal_latency_ms"] and found["goals"] >= 4
    assert found["cpu"]["server"] > 0 and found["cpu"]["generator"] > 0
    memory = found["server_rss_mb"]
    assert len(memory["samples"]) > 10 and memory["warm"] > 0 and memory["end"] > 0
    assert path.with_suffix(".png").stat().st_size > 1000
