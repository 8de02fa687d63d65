"""Run folders from a model folder, to continue from shipped weights without their runs.

What only training needs is not in a model folder (the predictor's encoder, the policy's critic):
those parts are initialised. Weights are those that ship, rounded to float16.
"""

import json
from pathlib import Path

import onnx
import torch
from onnx import TensorProto, numpy_helper
from torch import Tensor, nn

from wayfarer.artifacts import CARD
from wayfarer.body.library import load_body
from wayfarer.errors import ArtifactError
from wayfarer.marker_bodies import marker_body
from wayfarer.motion.policy import GoalPolicy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import GENDERS
from wayfarer_lab.training.pose_networks import PosePrior


def unpack_models(models: Path, runs: Path) -> dict[str, int]:
    """Write a run folder for each network of `models`; how many tensors of each were found.

    Folders that exist are left alone. Raises ArtifactError when a graph or the card is missing.
    """
    written = {}
    for name, (network, graphs) in _networks().items():
        folder = runs / name
        if folder.exists():
            continue
        weights = {k: v for graph in graphs for k, v in read_weights(models / graph).items()}
        if isinstance(network, BodyRegressor):
            weights |= _last_bias(network, models / graphs[0])
        own = network.state_dict()
        found = {k: v for k, v in weights.items() if k in own and own[k].shape == v.shape}
        if not found:
            raise ArtifactError(f"{models}: {graphs} hold no weights of {name}")
        folder.mkdir(parents=True)
        state = {"model": own | found, "optimizer": {}, "step": 0, "rng": torch.get_rng_state()}
        torch.save(state, folder / "last.pt")
        config, log = _settings(models, name)
        (folder / "config.json").write_text(json.dumps(config, indent=2) + "\n")
        (folder / "log.txt").write_text(log + "\n")
        written[name] = len(found)
    return written


def _networks() -> dict[str, tuple[nn.Module, tuple[str, ...]]]:
    """By run name: an untrained network and the graphs that hold its weights."""
    regressors = {
        f"regressor_{g}": (
            BodyRegressor(marker_body(load_body("anny52", g))),
            (f"regressor_{g}.onnx",),
        )
        for g in GENDERS
    }
    return regressors | {
        "predictor_1f": (MarkerPredictor(1), ("predictor_1f.onnx",)),
        "predictor_2f": (MarkerPredictor(2), ("predictor_2f.onnx",)),
        "policy": (GoalPolicy(), ("policy.onnx",)),
        "pose_prior": (PosePrior(), ("pose_encoder.onnx", "pose_decoder.onnx")),
    }


def read_weights(path: Path) -> dict[str, Tensor]:
    """Tensors of a graph by the name of the network's parameter. Raises ArtifactError."""
    try:
        graph = onnx.load(path).graph
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{path}: cannot be read: {error}") from error
    found = {}
    for tensor in graph.initializer:
        _, _, name = tensor.name.removesuffix(".f16").partition(".")  # without the network's own
        if name:
            found[name] = torch.from_numpy(numpy_helper.to_array(tensor).astype("float32").copy())
    return found


def _last_bias(network: BodyRegressor, path: Path) -> dict[str, Tensor]:
    """The bias of the regressor's last layer, which is exported in the order of its use."""
    order = network.by_number
    rows = [
        numpy_helper.to_array(t)
        for t in onnx.load(path).graph.initializer
        if list(t.dims) == [len(order)] and t.data_type == TensorProto.FLOAT
    ]
    if len(rows) != 1:
        raise ArtifactError(f"{path}: {len(rows)} tensors could be the last bias, expected one")
    bias = torch.empty(len(order))
    bias[order] = torch.from_numpy(rows[0].copy())
    last = len(network.network) - 1
    return {f"network.{last}.bias": bias}


def _settings(models: Path, name: str) -> tuple[dict[str, object], str]:
    """What a network was trained with, and its last log line. Raises ArtifactError."""
    _, section, rest = (models / CARD).read_text().partition(f"\n## {name}\n")
    said, fence, text = rest.partition("```json\n")
    log = [line.strip() for line in said.splitlines() if line.startswith("    ")]
    if not section or not fence or not log:
        raise ArtifactError(f"{models / CARD}: has no settings of {name}")
    settings: dict[str, object] = json.loads(text.partition("```")[0])
    return settings, log[-1]
