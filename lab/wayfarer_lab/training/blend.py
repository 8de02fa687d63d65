"""Weighted means of the weights of a network's runs.

A policy that was trained further beside a critic walks more like people and keeps less of what it
did not train on (running, turns). The mean of its weights with those it started from keeps both
(Wortsman et al. 2022, "Robust fine-tuning of zero-shot models", Eq. 1). Only runs that share a
start can be blended: means of networks trained apart are no networks.
"""

import json
from collections.abc import Mapping
from pathlib import Path

import torch
from torch import Tensor

from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer_lab.training.run import read_run_config


def blend_runs(shares: Mapping[Path, float], out: Path) -> None:
    """Write a run folder `out` with the mean of the runs' weights by their shares.

    Its checkpoint is for export and `start_from`; its settings are those of all runs.
    Raises InvalidArgument when `out` exists or shares are no shares, ArtifactError when a run
    cannot be read or is of another network.
    """
    if out.exists():
        raise InvalidArgument(f"{out} exists already", "out")
    if len(shares) < 2 or min(shares.values()) <= 0:
        raise InvalidArgument("give two runs or more, each with a share above 0", "runs")
    total = sum(shares.values())
    mean: dict[str, Tensor] = {}
    for run, share in shares.items():
        weights = _weights(run)
        shapes = {name: value.shape for name, value in weights.items()}
        if mean and shapes != {name: value.shape for name, value in mean.items()}:
            raise ArtifactError(f"{run / 'last.pt'}: weights of another network")
        for name, value in weights.items():
            mean[name] = mean.get(name, torch.zeros_like(value)) + value * (share / total)
    settings = {
        str(run.name): {"share": share / total, "settings": read_run_config(run)}
        for run, share in shares.items()
    }
    out.mkdir(parents=True)
    state = {"model": mean, "optimizer": {}, "step": 0, "rng": torch.get_rng_state()}
    torch.save(state, out / "last.pt")
    (out / "config.json").write_text(json.dumps({"blend": settings}, indent=2) + "\n")
    named = ", ".join(f"{run.name} {share / total:.2f}" for run, share in shares.items())
    (out / "log.txt").write_text(f"mean of the weights of {named}\n")


def _weights(run: Path) -> dict[str, Tensor]:
    """What is served of a run: the moving average of its weights, if it has one."""
    path = run / "last.pt"
    if not path.exists():
        raise ArtifactError(f"no checkpoint {path}")
    state = torch.load(path, weights_only=True)
    found: dict[str, Tensor] = state.get("average", state["model"])
    return found
