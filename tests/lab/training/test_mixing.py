"""A policy between two, by their weights."""

from pathlib import Path

import pytest
import torch

from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer_lab.training.mixing import mix_policies


def run(folder: Path, **weights: torch.Tensor) -> Path:
    folder.mkdir()
    torch.save({"model": weights, "step": 9}, folder / "last.pt")
    return folder


def test_weights_lie_between_those_of_both(tmp_path: Path) -> None:
    one = run(tmp_path / "one", w=torch.tensor([0.0, 2.0]))
    two = run(tmp_path / "two", w=torch.tensor([4.0, 2.0]))
    mix_policies(one, two, 0.25, tmp_path / "mixed")
    made = torch.load(tmp_path / "mixed" / "last.pt", weights_only=True)["model"]
    assert made["w"].tolist() == [1.0, 2.0]


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    one = run(tmp_path / "one", w=torch.zeros(2))
    two = run(tmp_path / "two", w=torch.zeros(3))
    with pytest.raises(ArtifactError, match="different shapes"):
        mix_policies(one, two, 0.5, tmp_path / "mixed")
    with pytest.raises(InvalidArgument, match="allowed: 0 to 1"):
        mix_policies(one, one, 1.5, tmp_path / "mixed")
    assert not (tmp_path / "mixed").exists()
