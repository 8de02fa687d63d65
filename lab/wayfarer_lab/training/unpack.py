"""Run folders from a model folder, to continue from shipped weights without their runs.

What only training needs is not in a model folder (the predictor's encoder, the policy's critic):
those parts are initialised. The other weights are the shipped ones, rounded to float16.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import onnx
import torch
from torch import Tensor, nn

from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.engines.torch.weights import count_networks, named, of_network, output_biases
from wayfarer.errors import ArtifactError
from wayfarer.models.artifacts import CARD
from wayfarer.motion.policy import fitting_policy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS
from wayfarer_lab.training.pose_networks import PosePrior


def unpack_models(models: Path, runs: Path) -> dict[str, int]:
    """Writes a run folder for each network of `models`; how many tensors of each were found.

    Folders that exist are left alone. Raises ArtifactError when a graph or the card is missing.
    """
    written = {}
    for name, (network, graphs) in _networks(models).items():
        folder = runs / name
        if folder.exists():
            continue
        found = _weights(network, [models / graph for graph in graphs])
        own = network.state_dict()
        folder.mkdir(parents=True)
        state = {"model": own | found, "optimizer": {}, "step": 0, "rng": torch.get_rng_state()}
        torch.save(state, folder / "last.pt")
        config, log = _settings(models, name)
        (folder / "config.json").write_text(json.dumps(config, indent=2) + "\n")
        (folder / "log.txt").write_text(log + "\n")
        written[name] = len(found)
    return written


def read_regressor(models: Path, gender: str) -> BodyRegressor:
    """The regressor of a model folder. Raises ArtifactError when its graph cannot be read."""
    path = models / f"regressor_{gender}.onnx"
    network = BodyRegressor(
        marker_body(load_body("anny52", gender)), count_networks(named(_open(path)))
    )
    network.load_state_dict(_weights(network, [path]))
    return network.eval()


def _networks(models: Path) -> dict[str, tuple[nn.Module, tuple[str, ...]]]:
    """By run name: an untrained network as large as the one shipped, and the graphs that hold its
    weights.
    """
    regressors = {
        f"regressor_{g}": (
            BodyRegressor(marker_body(load_body("anny52", g))),
            (f"regressor_{g}.onnx",),
        )
        for g in GENDERS
    }
    return regressors | {
        **{
            f"predictor_{n}f": (
                MarkerPredictor.fitting(_read(models / f"predictor_{n}f.onnx", "predictor"), n),
                (f"predictor_{n}f.onnx",),
            )
            for n in (1, 2)
        },
        "policy": (fitting_policy(_read(models / "policy.onnx", "policy")), ("policy.onnx",)),
        "pose_prior": (PosePrior(), ("pose_encoder.onnx", "pose_decoder.onnx")),
    }


def _read(path: Path, network: str) -> dict[str, Tensor]:
    """Weights that a graph has of a network, by its own names."""
    return of_network(named(_open(path)), network)


def _weights(network: nn.Module, paths: Sequence[Path]) -> dict[str, Tensor]:
    """Tensors of `network` that graphs hold, by its own names. Raises ArtifactError for none."""
    own, found = network.state_dict(), {}
    for path in paths:
        graph = _open(path)
        weights = named(graph)
        if isinstance(network, BodyRegressor):
            weights |= output_biases(graph, weights, network.by_number, path)
        for full, values in weights.items():
            name = full.partition(".")[2]  # without the network's own
            if name in own and own[name].shape == values.shape:
                found[name] = values
    if not found:
        raise ArtifactError(f"{[str(path) for path in paths]} hold no weights of the network")
    return found


def _open(path: Path) -> onnx.GraphProto:
    try:
        return onnx.load(path).graph
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{path}: cannot be read: {error}") from error


def _settings(models: Path, name: str) -> tuple[dict[str, object], str]:
    """The settings of a network's training, and its last log line. Raises ArtifactError."""
    _, section, rest = (models / CARD).read_text().partition(f"\n## {name}\n")
    said, fence, text = rest.partition("```json\n")
    log = [line.strip() for line in said.splitlines() if line.startswith("    ")]
    if not section or not fence or not log:
        raise ArtifactError(f"{models / CARD}: has no settings of {name}")
    settings: dict[str, object] = json.loads(text.partition("```")[0])
    return settings, log[-1]
