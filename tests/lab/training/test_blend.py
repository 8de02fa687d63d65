import json
from pathlib import Path

import pytest
import torch

from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer_lab.training.blend import blend_runs
from wayfarer_lab.training.run import load_weights


def run(folder: Path, value: float, size: int = 2, average: float | None = None) -> Path:
    folder.mkdir()
    state = {"model": {"weight": torch.full((1, size), value), "bias": torch.zeros(1)}}
    if average is not None:
        state["average"] = {"weight": torch.full((1, size), average), "bias": torch.zeros(1)}
    torch.save(state, folder / "last.pt")
    (folder / "config.json").write_text(json.dumps({"seed": value}))
    return folder


def test_a_blend_is_the_mean_by_shares_of_what_runs_serve(tmp_path):
    first, second = run(tmp_path / "a", 1.0), run(tmp_path / "b", 9.0, average=5.0)
    blend_runs({first: 3.0, second: 1.0}, tmp_path / "mean")
    network = load_weights(torch.nn.Linear(2, 1), tmp_path / "mean")
    assert network.weight.tolist() == [[2.0, 2.0]]
    told = json.loads((tmp_path / "mean" / "config.json").read_text())["blend"]
    assert told["a"] == {"share": 0.75, "settings": {"seed": 1.0}}
    assert "a 0.75, b 0.25" in (tmp_path / "mean" / "log.txt").read_text()


def test_what_cannot_be_blended_is_refused_and_nothing_is_written(tmp_path):
    first, second = run(tmp_path / "a", 1.0), run(tmp_path / "b", 2.0)
    out = tmp_path / "mean"
    for shares, error, told in (
        ({first: 1.0}, InvalidArgument, "two runs"),
        ({first: 1.0, second: 0.0}, InvalidArgument, "above 0"),
        ({first: 1.0, tmp_path / "none": 1.0}, ArtifactError, "no checkpoint"),
        ({first: 1.0, run(tmp_path / "c", 1.0, size=3): 1.0}, ArtifactError, "another network"),
    ):
        with pytest.raises(error, match=told):
            blend_runs(shares, out)
        assert not out.exists()
    with pytest.raises(InvalidArgument, match="exists already"):
        blend_runs({first: 1.0, second: 1.0}, first)
