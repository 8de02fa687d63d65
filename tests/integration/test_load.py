"""`wayfarer load` against a server that it starts itself: real processes, real streams."""

import json

import pytest
from typer.testing import CliRunner

from tests.serving import needs_ray
from wayfarer.commands.cli import app


def measured(tmp_path, monkeypatch, workers="1", **options):
    """The JSON of a short run."""
    monkeypatch.setenv("WAYFARER_ADMISSION", "false")  # a busy test machine must refuse no agent
    monkeypatch.setenv("WAYFARER_CANDIDATES", "1")
    monkeypatch.setenv("WAYFARER_WORKERS", workers)
    monkeypatch.setenv("WAYFARER_ENGINE", "onnxruntime")
    path = tmp_path / "run.json"
    options |= {"sessions": 2, "seconds": 2, "warm-up": 1, "goal-rate": 2, "json": path}
    words = [word for name, value in options.items() for word in (f"--{name}", str(value))]
    result = CliRunner().invoke(app, ["load", *words])
    assert result.exit_code == 0, result.output
    return json.loads(path.read_text())


@pytest.mark.parametrize(
    ("transport", "workers"), [("grpc", "1"), pytest.param("websocket", "2", marks=needs_ray)]
)
def test_a_run_measures_a_server_of_its_own_by_rings(tmp_path, monkeypatch, transport, workers):
    options = {"agents": 12, "rings": "full:4,part:7,root:14", "viewpoint-speed": 8}
    options |= {"slow": 1, "vanishing": 1, "transport": transport}
    found = measured(tmp_path, monkeypatch, workers, **options)
    assert found["agents"] == 24 and found["refused"] == 0
    assert found["chunks"] > 10
    assert found["lateness_ms"]["max"] >= found["lateness_ms"]["p50"] >= 0
    assert found["first_chunk_ms"] and found["goal_latency_ms"] and found["goals"] >= 4
    assert found["cpu"]["server"] > 0 and found["cpu"]["generator"] > 0
    memory = found["server_rss_mb"]
    moments = [moment for moment, _ in memory["samples"]]  # from the warm-up on to the end
    assert moments[0] < 0 and moments[-1] > 1
    assert memory["warm"] > 0 and memory["end"] > 0
    assert (tmp_path / "run.png").stat().st_size > 1000
    full, part, root = found["rings"]
    assert [ring["ring"] for ring in found["rings"]] == ["full:4", "part:7", "root:14"]
    assert all(ring["chunks"] for ring in found["rings"])
    assert sum(ring["chunks"] for ring in found["rings"]) == found["chunks"]
    assert full["kb_s_person"] > part["kb_s_person"] > root["kb_s_person"] > 0
    assert 0 < found["of_full"] < 1 and 0 < found["unseen_share"] < 1
    assert [found[fault] for fault in ("popped", "repeated", "malformed", "silent")] == [0] * 4
    assert not [name for name in found["failures"] if name.startswith("VIEWPOINTS")]
