"""Lower precision for products with the weights of networks, never for coordinates.

A metre is known to 4 mm in bfloat16, and to half a millimetre in TF32; the canonical frame, bodies,
quality terms and the way back to the world are therefore in full float32 whatever is asked for.
`tf32` rounds what goes into the networks' products to 10 bits; `bfloat16` also keeps their hidden
layers in it, as `openvino_network.py` does. On a device without TF32 that is float32.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, Literal

import torch
from torch import Tensor, nn

from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.policy import Condition, Policy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.primitive import PrimitiveStep, StepResult
from wayfarer.motion.quality import Sites
from wayfarer.motion.regressor import BodyRegressor

Precision = Literal["float32", "tf32", "bfloat16"]

FULL: Final = "ieee"


@contextmanager
def products(kind: str) -> Iterator[None]:
    """Sets how float32 matrices are multiplied on a GPU, for all threads: "ieee" or "tf32"."""
    backend: Any = torch.backends.cuda.matmul
    before = backend.fp32_precision
    backend.fp32_precision = kind
    try:
        yield
    finally:
        backend.fp32_precision = before


@contextmanager
def networks_in(precision: Precision, device: torch.device) -> Iterator[None]:
    """Precision of the networks' part of a step."""
    if precision == "tf32":
        with products("tf32"):
            yield
    elif precision == "bfloat16":
        with torch.autocast(device.type, torch.bfloat16):
            yield
    else:
        yield


class MixedRegressor(BodyRegressor):
    """A regressor whose networks, but not whose body, are in lower precision."""

    def __init__(self, body: MarkerBody, networks: int, precision: Precision) -> None:
        super().__init__(body, networks)
        self.precision = precision

    def correct(
        self, network: nn.Sequential, centred: Tensor, error: Tensor, betas: Tensor, rows: Tensor
    ) -> Tensor:
        """See `BodyRegressor`."""
        with networks_in(self.precision, rows.device):
            return super().correct(network, centred, error, betas, rows)


class MixedStep(PrimitiveStep):
    """A step whose networks are in lower precision."""

    def __init__(
        self,
        predictor: MarkerPredictor,
        regressor: MixedRegressor,
        body: MarkerBody,
        sites: Sites,
        policy: Policy | None,
        floor_origin: bool,
        precision: Precision,
    ) -> None:
        super().__init__(predictor, regressor, body, sites, policy, floor_origin)
        self.precision = precision

    def forward(self, *inputs: Tensor, **named: Tensor) -> StepResult:
        """See `PrimitiveStep`; every output is laid out without gaps."""
        with products(FULL):
            result = super().forward(*inputs, **named)
        return StepResult(*(values.contiguous() for values in result))

    def predict(self, seed: Tensor, asked: Condition, noise: Tensor, share: Tensor) -> Tensor:
        """See `PrimitiveStep`."""
        with networks_in(self.precision, seed.device):
            return super().predict(seed, asked, noise, share)
