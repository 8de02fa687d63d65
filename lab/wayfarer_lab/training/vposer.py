"""Read a user's VPoser v2 checkpoint into our own network, by the names and shapes of its tensors.

The file is a checkpoint of PyTorch Lightning, read by `checkpoint.py`.
"""

from pathlib import Path

from torch import Tensor

from wayfarer.errors import ArtifactError
from wayfarer_lab.training.checkpoint import read_tensors
from wayfarer_lab.training.pose_networks import VPoser

PREFIX = "vp_model."
LAYERS = {
    "encoder_net.1": "encoder.0",
    "encoder_net.2": "encoder.1",
    "encoder_net.4": "encoder.3",
    "encoder_net.6": "encoder.4",
    "encoder_net.7": "encoder.5",
    "encoder_net.8.mu": "mean",
    "encoder_net.8.logvar": "spread",
    "decoder_net.0": "decoder.0",
    "decoder_net.3": "decoder.2",
    "decoder_net.5": "decoder.4",
}
"""Layer in the file → layer of `VPoser`. Numbers left out have no weights there (dropout …)."""


def load_vposer(path: Path) -> VPoser:
    """The network of a checkpoint such as V02_05/snapshots/V02_05_epoch=….ckpt, ready for use.

    Raises ArtifactError, which names the file, the tensor, and what was expected.
    """
    found = _tensors(path)
    given = {}
    for name, tensor in found.items():
        layer, _, kind = name.rpartition(".")
        if layer in LAYERS:
            given[f"{LAYERS[layer]}.{kind}"] = tensor
    first = given.get("encoder.1.weight")
    if first is None or first.ndim != 2:
        raise ArtifactError(
            f"{path}: no VPoser v2: expected {PREFIX}encoder_net.2.weight [neurons, 63] among its "
            f"tensors; found {sorted(found)[:8]}"
        )
    model = VPoser(neurons=len(first))
    wanted = {name: tuple(tensor.shape) for name, tensor in model.state_dict().items()}
    in_file = {ours: theirs for theirs, ours in LAYERS.items()}
    for name, shape in wanted.items():
        layer, _, kind = name.rpartition(".")
        where = f"{path}: {PREFIX}{in_file[layer]}.{kind}"
        if name not in given:
            raise ArtifactError(f"{where}: is missing, expected shape {shape}")
        if tuple(given[name].shape) != shape:
            raise ArtifactError(
                f"{where}: found shape {tuple(given[name].shape)}, expected {shape}"
            )
    model.load_state_dict(given)
    return model.eval().requires_grad_(False)


def _tensors(path: Path) -> dict[str, Tensor]:
    """Tensors of a checkpoint by name, `PREFIX` taken off."""
    found = read_tensors(path, ("state_dict",))
    return {name.removeprefix(PREFIX): tensor for name, tensor in found.items()}
