"""The trained networks one by one, for combinations that the served graph does not offer.

They come from a model folder (the ONNX graphs that other engines run; of regressors the weights, as
those graphs take single frames) or from training runs (torch weights, base predictors included),
with the same interface: that of the modules in `motion`.
Forward only: an ONNX graph has no gradients.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numpy as np
import onnxruntime
import torch
from torch import Tensor, nn

from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import load_marker_bodies
from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer.models.artifacts import GRAPHS, open_session
from wayfarer.models.bundle import load_models
from wayfarer.motion.policy import Condition, Gaussian, Policy
from wayfarer.motion.predictor import MarkerPredictor, Posterior
from wayfarer.motion.primitive import BLEND, GROUNDING, PrimitiveStep
from wayfarer.motion.quality import Sites
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.process.processor import cores
from wayfarer.spec import GENDERS, PRIMITIVE_FRAMES
from wayfarer_lab.evaluation.fitted import FittedStep
from wayfarer_lab.training.pose_networks import PosePrior
from wayfarer_lab.training.regressor import load_regressor
from wayfarer_lab.training.representation import REPRESENTATIONS, BodyParameters
from wayfarer_lab.training.run import (
    load_policy,
    load_predictor,
    load_weights,
    read_run_config,
)
from wayfarer_lab.training.unpack import read_regressor

SHIPPED: Final = {"ro-1f": "predictor_1f.onnx", "ro-2f": "predictor_2f.onnx"}
"""Predictors of a model folder by the paper's names; the shipped ones are trained on rollouts."""

TRAINED: Final = {
    "1f": "predictor_1f",
    "2f": "predictor_2f",
    "ro-1f": "predictor_1f_rollout",
    "ro-2f": "predictor_2f_rollout",
}
"""Run folders of the predictors, in the order of Tab. S1 (the recipe: docs/models.md)."""


Part = TypeVar("Part")


@dataclass(frozen=True)
class Variant:
    """One way to join the parts; `name` is its row."""

    name: str
    predictor: str  # "1f", "2f" are trained on single primitives, "ro-1f", "ro-2f" over rollouts
    blend: float = BLEND  # share of reprojected markers in the next seed
    grounding: float = GROUNDING  # share of the height error taken off in a primitive; 0: none
    policy: bool = False  # latents from the policy rather than from N(0, I)
    fitted: int = 0  # iterations of reprojection by optimisation, as MOJO's; 0: the regressor


DIRECT: Final = {
    "direct-body": "direct_body",
    "direct-humor": "direct_humor",
    "ro-direct-body": "direct_body_rollout",
    "ro-direct-humor": "direct_humor_rollout",
}
"""Run folders of predictors of body parameters (Sec. A.4)."""


@dataclass(frozen=True)
class Direct:
    """A predictor that needs no regressor: its frames are body parameters."""

    predictor: MarkerPredictor
    kind: BodyParameters
    floor_origin: bool


@dataclass(frozen=True)
class Parts:
    """Networks by name, and the bodies that they were trained on."""

    predictors: Mapping[str, MarkerPredictor]
    regressors: Mapping[str, BodyRegressor]  # by gender
    policy: Policy | None
    pose_prior: PosePrior | None
    floor_origin: bool
    direct: Mapping[str, Direct] = field(default_factory=dict)

    def step(self, gender: str, variant: Variant) -> PrimitiveStep:
        """The step of `variant`. Raises InvalidArgument when a part is missing."""
        if variant.predictor not in self.predictors:
            raise InvalidArgument(
                f"variant {variant.name!r} needs predictor {variant.predictor!r}; "
                f"there are {sorted(self.predictors)}"
            )
        if variant.policy and self.policy is None:
            raise InvalidArgument(f"variant {variant.name!r} needs a policy, and there is none")
        body = load_marker_bodies()[gender]
        kind = FittedStep if variant.fitted else PrimitiveStep
        step = kind(
            self.predictors[variant.predictor],
            self.regressors[gender],
            body,
            Sites.from_names(load_body("anny52", gender, "low").marker_names),
            self.policy if variant.policy else None,
            self.floor_origin,
            variant.blend,
            variant.grounding,
        ).eval()
        if isinstance(step, FittedStep):
            step.iterations = variant.fitted
        return step


def some(named: Mapping[str, Part], only: str) -> dict[str, Part]:
    """Those called `only` (names with commas between them), in that order; all without it.

    Raises InvalidArgument for a name that is not there.
    """
    names = [name for name in only.split(",") if name] or list(named)
    if unknown := sorted(set(names) - set(named)):
        raise InvalidArgument(f"there is no {unknown}; there are {list(named)}", "only")
    return {name: named[name] for name in names}


def load_parts(models: Path, runs: Path | None = None, threads: int = 0) -> Parts:
    """The parts of a model folder; with `runs`, networks trained there replace them.

    `threads` go to onnxruntime and to torch; 0: all cores. Raises ArtifactError.
    """
    threads = threads or min(torch.get_num_threads(), cores())
    torch.set_num_threads(threads)
    parts = _from_models(models, threads)
    return parts if runs is None else _with_runs(parts, runs)


def _from_models(path: Path, threads: int) -> Parts:
    folder = load_models(path)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads

    def session(file: str) -> onnxruntime.InferenceSession | None:
        return open_session(path / file, options) if file in folder.contracts else None

    predictors = {
        name: cast(MarkerPredictor, OnnxPredictor(found, GRAPHS[file].seed_frames))
        for name, file in SHIPPED.items()
        if (found := session(file))
    }
    regressors = {gender: read_regressor(path, gender) for gender in GENDERS}
    found = session("policy.onnx")
    policy = cast(Policy, OnnxPolicy(found)) if found else None
    found, decoder = session("pose_encoder.onnx"), session("pose_decoder.onnx")
    prior = cast(PosePrior, OnnxPosePrior(found, decoder)) if found and decoder else None
    floor_origin = all(contract.floor_origin for contract in folder.contracts.values())
    return Parts(predictors, regressors, policy, prior, floor_origin)


def _with_runs(parts: Parts, runs: Path) -> Parts:
    """Replaces parts that have a checkpoint under `runs`. Raises ArtifactError for none."""
    bodies = load_marker_bodies()
    predictors = dict(parts.predictors)
    regressors = dict(parts.regressors)
    policy, prior, floors = parts.policy, parts.pose_prior, set()
    for name, folder in TRAINED.items():
        if _finished(runs / folder):
            config = read_run_config(runs / folder)
            floors.add(bool(config["floor_origin"]))
            predictors[name] = load_predictor(runs / folder, config["seed_frames"])
    for gender in GENDERS:
        if _finished(runs / f"regressor_{gender}"):
            regressors[gender] = load_regressor(bodies[gender], runs / f"regressor_{gender}")
    if _finished(runs / "policy"):
        policy = load_policy(runs / "policy")
    if _finished(runs / "pose_prior"):
        prior = load_weights(PosePrior(), runs / "pose_prior")
    if len(floors) > 1:
        raise ArtifactError(f"{runs}: predictors differ in floor_origin and cannot be compared")
    direct = {
        name: _direct(runs / folder) for name, folder in DIRECT.items() if _finished(runs / folder)
    }
    names = [
        *(*TRAINED.values(), *DIRECT.values()),
        *(f"regressor_{g}" for g in GENDERS),
        *("policy", "pose_prior"),
    ]
    if not any(_finished(runs / name) for name in names):
        raise ArtifactError(f"{runs}: holds no checkpoint NAME/last.pt of {names}")
    floor = floors.pop() if floors else parts.floor_origin
    predictors = {name: predictors[name] for name in TRAINED if name in predictors}
    return Parts(predictors, regressors, policy, prior, floor, direct)


def _direct(run: Path) -> Direct:
    """Raises ArtifactError for a run whose frames are no body parameters."""
    config = read_run_config(run)
    kind = REPRESENTATIONS[config["representation"]]()
    if not isinstance(kind, BodyParameters):
        raise ArtifactError(f"{run}: its frames are {config['representation']}")
    predictor = load_predictor(run, config["seed_frames"])
    return Direct(predictor, kind, bool(config["floor_origin"]))


def _finished(run: Path) -> bool:
    return (run / "last.pt").exists()


class OnnxPredictor(nn.Module):
    """An exported decoder with the interface of `MarkerPredictor`."""

    def __init__(self, session: onnxruntime.InferenceSession, seed_frames: int) -> None:
        super().__init__()
        self.session = session
        self.seed_frames = seed_frames
        self.new_frames = PRIMITIVE_FRAMES - seed_frames

    def decode(self, seed: Tensor, latent: Tensor) -> Tensor:
        """Seed [A, S, 201], latent [A, K, 128] → future [A, K, F, 201]."""
        count = latent.shape[1]
        rows = seed.repeat_interleave(count, 0)
        (future,) = _run(self.session, ["future"], {"seed": rows, "latent": latent.flatten(0, 1)})
        return future.unflatten(0, (-1, count))


class OnnxPolicy(nn.Module):
    """An exported actor with the interface of a `Policy`; it takes seeds of 2 frames."""

    def __init__(self, session: onnxruntime.InferenceSession) -> None:
        super().__init__()
        self.session = session

    def forward(self, seed: Tensor, condition: Condition) -> Gaussian:
        """Seed [A, 2, 201], canonical frame → the distribution of latents."""
        given = {"seed": seed, **condition._asdict()}
        return Gaussian(*_run(self.session, Gaussian._fields, given))


class OnnxPosePrior(nn.Module):
    """An exported pose encoder and decoder with the interface of `PosePrior`."""

    def __init__(
        self, session: onnxruntime.InferenceSession, decoder: onnxruntime.InferenceSession
    ) -> None:
        super().__init__()
        self.session = session
        self.decoder = decoder

    def encode(self, rotations: Tensor) -> Posterior:
        """Local rotations [N, 21, 3, 3] → where in the latent space the poses lie [N, 32]."""
        return Posterior(*_run(self.session, Posterior._fields, {"rotations": rotations}))

    def decode(self, latent: Tensor) -> Tensor:
        """Latents [N, 32] → local rotations [N, 21, 3, 3]."""
        return _run(self.decoder, ["rotations"], {"latent": latent})[0]


def _run(session: Any, outputs: Any, given: Mapping[str, Tensor]) -> list[Tensor]:
    arrays = {name: np.ascontiguousarray(value.numpy()) for name, value in given.items()}
    return [torch.from_numpy(out) for out in session.run(list(outputs), arrays)]
