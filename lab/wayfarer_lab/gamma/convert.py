"""Tensors of GAMMA-release's checkpoints → our networks, by name and shape.

A checkpoint (`epoch-300.ckp`) is a dictionary with `model_state_dict`. That of a predictor, of a
regressor, of a policy, and of the "combo" of predictor and regressor differ in their names.
What only its configuration file knows is an argument here.
"""

from collections.abc import Mapping
from pathlib import Path

import torch
from torch import Tensor, nn

from wayfarer.errors import ArtifactError
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.spec import BETAS, LATENT, MARKERS
from wayfarer_lab.gamma.networks import PARAMETERS, PASSES, GammaPolicy, GammaRegressor
from wayfarer_lab.training.checkpoint import read_tensors
from wayfarer_lab.training.run import Network
from wayfarer_lab.training.smpl_joints import SmplJoints

SECTIONS = ("model_state_dict",)
AXIS_ANGLE_PARAMETERS = 3 + 22 * 3 + 24

_RECURRENT = {
    "weight_ih_l0": "from_input.weight",
    "bias_ih_l0": "from_input.bias",
    "weight_hh_l0": "from_state.weight",
    "bias_hh_l0": "from_state.bias",
}
_PREDICTOR = {
    "x_enc": "seed_encoder",
    "e_rnn": "future_encoder",
    "e_mlp.layers.0": "posterior.0",
    "e_mlp.layers.1": "posterior.2",
    "e_mu": "mean",
    "e_logvar": "log_variance",
    "drnn_mlp.layers.0": "first_state.0",
    "drnn_mlp.layers.1": "first_state.2",
    "drnn_mlp.layers.2": "first_state.4",
    "d_mlp.layers.0": "output.0.0",
    "d_mlp.layers.1": "output.0.2",
    "d_out": "output.1",
}
"""Their layer → `MarkerPredictor`'s, except for the decoder's recurrent cell."""


class Tensors:
    """A checkpoint's tensors; a requested tensor must exist in the expected shape."""

    def __init__(self, path: Path, part: str) -> None:
        """`part` is the prefix that this network has in a combo: predictor, regressor."""
        self.path = path
        found = read_tensors(path, SECTIONS)
        of_combo = {k.removeprefix(f"{part}."): v for k, v in found.items() if k.startswith(part)}
        self.found = of_combo or found

    def get(self, name: str, *shape: int) -> Tensor:
        """Raises ArtifactError naming the tensor, found and expected; 0 stands for any size."""
        if name not in self.found:
            raise ArtifactError(
                f"{self.path}: tensor {name} is missing, expected shape {shape}; "
                f"found {sorted(self.found)[:6]} …"
            )
        tensor = self.found[name].float()
        same = len(shape) == tensor.ndim and all(
            want in (0, got) for want, got in zip(shape, tensor.shape, strict=True)
        )
        if not same:
            raise ArtifactError(
                f"{self.path}: tensor {name} has shape {tuple(tensor.shape)}, expected {shape}"
            )
        return tensor

    def count(self, pattern: str) -> int:
        """How many layers there are, by a name with {} for their number."""
        number = 0
        while pattern.format(number) in self.found:
            number += 1
        return number


def load_predictor(path: Path, seed_frames: int) -> MarkerPredictor:
    """The marker predictor of a checkpoint (MPVAE_1frame…, MPVAE_2frame…). Raises ArtifactError.

    A checkpoint does not say how long its seeds are: `seed_frames` must be right.
    """
    given, model = Tensors(path, "predictor"), MarkerPredictor(seed_frames)
    own = model.state_dict()
    names: dict[str, str] = {}
    for theirs, ours in _PREDICTOR.items():
        recurrent = f"{ours}.from_input.weight" in own
        for a, b in (_RECURRENT if recurrent else {"weight": "weight", "bias": "bias"}).items():
            names[f"{theirs}.{a}"] = f"{ours}.{b}"
    state = {ours: given.get(theirs, *own[ours].shape) for theirs, ours in names.items()}
    hidden = model.decoder.hidden
    inputs = hidden + LATENT + MARKERS * 3  # seed, latent, last frame
    cell = given.get("d_rnn.weight_ih", 3 * hidden, inputs)
    parts = ("from_seed.weight", "from_latent.weight", "decoder.from_input.weight")
    state |= dict(zip(parts, cell.split((hidden, LATENT, MARKERS * 3), 1), strict=True))
    state["decoder.from_input.bias"] = given.get("d_rnn.bias_ih", 3 * hidden)
    state["decoder.from_state.weight"] = given.get("d_rnn.weight_hh", 3 * hidden, hidden)
    state["decoder.from_state.bias"] = given.get("d_rnn.bias_hh", 3 * hidden)
    state |= {k: torch.zeros_like(v) for k, v in own.items() if k.startswith("prior.")}  # N(0, I)
    return _ready(model, state)


def load_policy(path: Path) -> GammaPolicy:
    """The policy of a checkpoint (MPVAEPolicy…), its critic left out. Raises ArtifactError."""
    given = Tensors(path, "policy")
    hidden = given.get("pnet.out_fc.weight", 2 * LATENT, 0).shape[1]
    blocks = given.count("pnet.layers.{}.layers.0.weight")
    model = GammaPolicy(hidden, blocks)
    names = {f"x_enc.{a}": f"encoder.{b}" for a, b in _RECURRENT.items()}
    names |= _linear("pnet.out_fc", "output")
    for block in range(blocks):
        for theirs, ours in ((0, 0), (1, 2)):
            names |= _linear(f"pnet.layers.{block}.layers.{theirs}", f"actor.{block}.layers.{ours}")
    return _ready(model, _renamed(given, names, model))


def load_regressor(path: Path, root: SmplJoints, passes: int = PASSES) -> GammaRegressor:
    """The body regressor of a checkpoint (MoshRegressor…). Raises ArtifactError.

    `root` are the joints of the body that it was trained on; `passes` is its `n_recur`.
    """
    given = Tensors(path, "regressor")
    outputs = given.get("pnet.out_fc.bias", 0).shape[0]
    if outputs == AXIS_ANGLE_PARAMETERS:
        raise ArtifactError(
            f"{path}: rotations are in axis-angle ({outputs} parameters); only regressors with "
            f"6D rotations (use_cont: true, {PARAMETERS} parameters) can be imported"
        )
    hidden = given.get("pnet.in_fc.bias", 0).shape[0]
    blocks = given.count("pnet.layers.{}.layers.0.weight")
    mean, dirs = (torch.from_numpy(a[0].copy()) for a in (root.mean, root.dirs))
    if dirs.shape[-1] < BETAS:
        raise ArtifactError(f"the body model has {dirs.shape[-1]} betas, {BETAS} are needed")
    model = GammaRegressor(mean, dirs[:, :BETAS], hidden, blocks, passes)
    names = _linear("pnet.in_fc", "network.0")
    names |= _linear("pnet.out_fc", f"network.{blocks + 1}")
    for block in range(blocks):
        theirs = f"pnet.layers.{block}.layers"
        names |= _linear(f"{theirs}.0", f"network.{block + 1}.first")
        names |= _linear(f"{theirs}.1", f"network.{block + 1}.second")
    return _ready(model, _renamed(given, names, model))


def _linear(theirs: str, ours: str) -> dict[str, str]:
    return {f"{theirs}.{kind}": f"{ours}.{kind}" for kind in ("weight", "bias")}


def _renamed(given: Tensors, names: Mapping[str, str], model: nn.Module) -> dict[str, Tensor]:
    own = model.state_dict()
    return {ours: given.get(theirs, *own[ours].shape) for theirs, ours in names.items()}


def _ready(model: Network, state: Mapping[str, Tensor]) -> Network:
    model.load_state_dict(dict(state))
    return model.eval().requires_grad_(False)
