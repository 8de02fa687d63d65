"""The step of a model folder as a torch module: its weights, from the ONNX graph that serves.

A graph names its weights as the networks do, so one file is enough for every engine. Only the
biases of the regressor's last layers have other names, since the exporter folds the order of the
regressor's numbers into them. They are found next to those layers' products, and restored to the
order of training.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Final, TypeVar

import onnx
import torch
from google.protobuf.message import DecodeError
from onnx import numpy_helper
from torch import Tensor, nn

from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.engines.torch.precision import MixedRegressor, MixedStep, Precision
from wayfarer.errors import ArtifactError
from wayfarer.models.artifacts import ModelFolder
from wayfarer.motion.policy import fitting_policy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.quality import Sites
from wayfarer.motion.regressor import BLOCKS
from wayfarer.spec import SEED_FRAMES

Weights = Mapping[str, Tensor]
Network = TypeVar("Network", bound=nn.Module)

HALF: Final = ".f16"
"""Ends the names of weights that are kept as float16 (`onnx_files.py`)."""

NETWORKS: Final = "regressor.networks."
"""Begins the names of the regressor's weights."""

FOR_TRAINING: Final = ("future_encoder.", "posterior.", "mean.", "log_variance.", "critic.")
"""Parts of networks that a step has no use for: their weights are not shipped."""


def load_step(models: ModelFolder, gender: str, precision: Precision) -> MixedStep:
    """The step that a folder's graph was exported from, on the CPU.

    Raises ArtifactError when it cannot be read, or another version of the networks was exported.
    """
    path = models.graph("step", gender, SEED_FRAMES)
    graph = _open(path)
    weights = named(graph)
    body = load_body(models.body, gender)
    skin = marker_body(body)
    regressor = MixedRegressor(skin, count_networks(weights), precision)
    weights |= output_biases(graph, weights, regressor.by_number, path)
    policy = of_network(weights, "policy")
    predictor = MarkerPredictor.fitting(of_network(weights, "predictor"), SEED_FRAMES)
    return MixedStep(
        _filled(predictor, "predictor", weights, path),
        _filled(regressor, "regressor", weights, path),
        skin,
        Sites.from_names(body.marker_names),
        _filled(fitting_policy(policy), "policy", weights, path) if policy else None,
        models.contracts[path.name].floor_origin,
        precision,
    ).eval()


def named(graph: onnx.GraphProto) -> dict[str, Tensor]:
    """A graph's constants by name, as float32 if they are numbers."""
    found = {}
    for constant in graph.initializer:
        values = torch.from_numpy(numpy_helper.to_array(constant).copy())
        name = constant.name.removesuffix(HALF)
        found[name] = values.float() if values.is_floating_point() else values
    return found


def _open(path: Path) -> onnx.GraphProto:
    try:
        return onnx.load(path).graph
    except (OSError, DecodeError, onnx.checker.ValidationError) as error:
        raise ArtifactError(f"{path}: cannot be read as ONNX: {error}") from error


def of_network(weights: Weights, name: str) -> dict[str, Tensor]:
    """The weights of one network, by its own names."""
    begin = f"{name}."
    return {k.removeprefix(begin): v for k, v in weights.items() if k.startswith(begin)}


def count_networks(weights: Weights) -> int:
    """The number of the regressor's networks in these weights."""
    return len({k.split(".")[2] for k in weights if k.startswith(NETWORKS)})


def output_biases(
    graph: onnx.GraphProto, weights: Weights, by_number: Tensor, path: Path
) -> dict[str, Tensor]:
    """The biases of the regressor's last layers, by name, in the order of training.

    Raises ArtifactError when they cannot be found.
    """
    found = {}
    for number in range(count_networks(weights)):
        last = f"{NETWORKS}{number}.{BLOCKS + 1}"
        rows = {node.output[0] for node in graph.node if f"{last}.weight" in node.input}
        products = [node for node in graph.node if node.op_type == "Gemm" and node.input[1] in rows]
        names = {product.input[2] for product in products}
        if len(names) != 1:
            raise ArtifactError(
                f"{path}: found {len(names)} biases of {last}, expected 1: export the model again"
            )
        ordered = weights[names.pop()]
        found[f"{last}.bias"] = torch.empty_like(ordered).index_copy(0, by_number, ordered)
    return found


def _filled(network: Network, name: str, weights: Weights, path: Path) -> Network:
    """The network with its weights. Raises ArtifactError when one is missing, of another shape, or
    left over.

    Graphs from before the learned prior have no weights for it; the network starts with N(0, I).
    """
    learned = any(key.startswith(f"{name}.prior.") for key in weights)
    unused = FOR_TRAINING if learned else (*FOR_TRAINING, "prior.")
    for key, parameter in network.named_parameters():
        if key.startswith(unused):
            continue
        found = weights.get(f"{name}.{key}")
        if found is None or found.shape != parameter.shape:
            shown = "nothing" if found is None else f"shape {list(found.shape)}"
            raise ArtifactError(
                f"{path}: {name}.{key}: found {shown}, expected shape {list(parameter.shape)}: "
                "it was exported from another version of the networks; export the model again"
            )
        parameter.data.copy_(found)
    known = {f"{name}.{key}" for key, _ in network.named_parameters()}
    left = sorted(key for key in weights if key.startswith(f"{name}.") and key not in known)
    if left:
        raise ArtifactError(f"{path}: {left[0]}: the torch engine has no place for it")
    return network
