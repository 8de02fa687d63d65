"""The engine on torch, for GPUs: a CUDA graph for each gender, size of batch and candidates.

An optional extra (`pip install '.[gpu]'`). It runs the modules that the served ONNX graphs
were exported from, with the weights of those graphs (`weights.py`), in the precision of
`precision.py`.
"""

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import torch

from wayfarer.engines.engine import EngineKind, StepInputs, StepOutputs, variant
from wayfarer.engines.padding import join, part
from wayfarer.engines.torch.batch import DeviceStep
from wayfarer.engines.torch.cuda_graph_stream import CudaGraphStream, chosen_device
from wayfarer.engines.torch.precision import MixedStep, Precision
from wayfarer.engines.torch.weights import load_step
from wayfarer.engines.warm import WarmEngine
from wayfarer.models.artifacts import ModelFolder, sha256_of
from wayfarer.spec import GENDERS, SEED_FRAMES
from wayfarer.terms import TERMS

BATCH_SIZES: Final = (64, 256, 1024, 4096, 16384, 32768)
"""Few, since each is a separate recording. A GPU is not busy with less than some thousand rows, so
that padding costs little."""

SUFFIX: Final[Mapping[Precision, str]] = {"float32": "", "tf32": "-tf32", "bfloat16": "-bf16"}


@dataclass(frozen=True)
class Networks:
    """A model on a device, which engines may share."""

    name: str
    graphs: tuple[str, ...]  # SHA-256 of the graphs that hold its weights
    steps: Mapping[str, MixedStep]  # by gender
    device: torch.device
    precision: Precision


def load_networks(
    models: ModelFolder, device: str | None = None, precision: Precision = "float32"
) -> Networks:
    """A model folder's networks on `device`, like `cuda:1` or `cpu`; None: the first GPU.

    Raises InvalidArgument without a GPU, ArtifactError.
    """
    chosen = chosen_device(device)
    return Networks(
        name=models.path.resolve().name,
        graphs=tuple(sha256_of(models.graph("step", g, SEED_FRAMES)) for g in GENDERS),
        steps={g: load_step(models, g, precision).to(chosen) for g in GENDERS},
        device=chosen,
        precision=precision,
    )


class TorchEngine(WarmEngine):
    """Steps agents on a GPU. Implements `Engine`, except for the last bits of its rows.

    The same inputs give the same bits if the rows are padded to the same size, on one GPU and one
    version of its libraries. A single size in `batch_sizes` therefore keeps rows independent of
    their batch and logs replayable. Batches of different sizes use different kernels, whose sums
    differ in the last bits.

    On a CPU it runs without graphs, with torch's own number of threads, for tests.
    """

    setting: EngineKind = "torch"
    term_names: tuple[str, ...] = TERMS

    def __init__(
        self,
        networks: Networks,
        batch_sizes: tuple[int, ...] = BATCH_SIZES,
        background: bool = False,
    ) -> None:
        """`batch_sizes` ascend; in the `background`, other engines' work on the GPU goes first."""
        self.name = networks.name
        self.kind = f"torch{SUFFIX[networks.precision]}"
        self.graphs = tuple(variant(self.kind, graph) for graph in networks.graphs)
        self.batch_sizes = self.to_compile = batch_sizes
        self.full = batch_sizes[-1]
        self.networks = networks
        self._lane = CudaGraphStream(networks.device, background)
        self._turn = threading.Lock()
        self._batches: dict[tuple[str, int, int], DeviceStep] = {}

    @cached_property
    def single_threaded(self) -> "TorchEngine":
        """See `Engine`: on the same weights, in the background of the GPU."""
        return TorchEngine(self.networks, self.batch_sizes, background=True)

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        """Steps all rows; see `Engine`. A size that has not been warmed is recorded first (1 s)."""
        rows, largest = len(inputs.goal), self.batch_sizes[-1]
        with self._turn, torch.no_grad():
            parts = [
                self._step(gender, part(inputs, start, min(start + largest, rows)))
                for start in range(0, rows, largest)
            ]
        return join(parts)

    def _step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        rows, candidates = inputs.noise.shape[:2]
        size = next(size for size in self.batch_sizes if size >= rows)
        key = (gender, size, candidates)
        if key not in self._batches:
            step = self.networks.steps[gender]
            self._batches[key] = DeviceStep(step, self._lane, size, candidates)
        return self._batches[key].step(inputs)


def open_gpu_engine(models: ModelFolder) -> TorchEngine:
    """An engine on the first GPU, in float32. Raises ArtifactError, InvalidArgument (no GPU)."""
    return TorchEngine(load_networks(models))
