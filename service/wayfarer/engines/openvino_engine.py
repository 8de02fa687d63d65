"""The engine on OpenVINO: a network compiled for each size of batch, in bfloat16 where it may.

An optional extra (`pip install '.[openvino]'`) for x86-64 CPUs. With AVX-512-BF16 or AMX it
takes half the time of onnxruntime or less; `openvino_network.py` says what is computed in
bfloat16.
"""

import threading
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
import structlog

from wayfarer import __version__
from wayfarer.engines import openvino_network
from wayfarer.engines.compiled_networks import CompiledNetworks, KeptNetwork
from wayfarer.engines.engine import (
    LEFT_OUT,
    EngineKind,
    StepInputs,
    StepOutputs,
    unscored,
    variant,
)
from wayfarer.engines.openvino_network import with_hidden_bfloat16
from wayfarer.engines.padding import pad
from wayfarer.engines.row_partitioner import RowPartitioner, give_way
from wayfarer.engines.warm import WarmEngine
from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer.models.artifacts import ModelFolder, sha256_of
from wayfarer.spec import GENDERS, SEED_FRAMES
from wayfarer.terms import TERMS

if TYPE_CHECKING:
    import openvino

log = structlog.get_logger(__name__)

INPUTS: Final = tuple(f.name for f in fields(StepInputs))
OUTPUTS: Final = tuple(f.name for f in fields(StepOutputs))
DEVICE: Final = "CPU"

UNFUSED: Final = {"SNIPPETS_MODE": "DISABLE"}
"""Groups of small operators are not fused. Each group would keep a separate network in every
stream: 40 % of the memory and a third of the time to compile, for no speed that we measured. It is
none of OpenVINO's public settings."""

BITS: Final = 2
"""Raised when networks are compiled in another way, whose last bits differ: logs name it."""

SIZES: Final = (16, 128)
"""Rows for one thread. Each size is a separate network: a second to compile, and 80 MB."""

MOST: Final = 48
"""Rows that are computed 16 at a time: for more, 128 cost less, though some of them be padding."""


class OpenVinoEngine(WarmEngine):
    """Runs a model folder's step graphs. Implements `WarmEngine`."""

    setting: EngineKind = "openvino"
    full = SIZES[-1]
    to_compile = SIZES
    term_names: tuple[str, ...] = TERMS

    def __init__(
        self,
        models: ModelFolder,
        threads: int = 0,
        bfloat16: bool | None = None,
        compiled: Path | None = None,
    ) -> None:
        """`threads` per call; 0: one per core. `bfloat16` None: where the CPU computes in it.
        `compiled`: folder where compiled networks are kept; None: they are not.

        Raises InvalidArgument without OpenVINO. A graph that it cannot read is an ArtifactError of
        the first step that needs it.
        """
        self._core = open_core()
        capable = "BF16" in self._core.get_property(DEVICE, "OPTIMIZATION_CAPABILITIES")
        self.bfloat16 = capable if bfloat16 is None else bfloat16
        self.kind = "openvino-bf16" if self.bfloat16 else "openvino"
        self.name = models.path.resolve().name
        self._models = models
        scored = [sha256_of(models.graph("step", g, SEED_FRAMES)) for g in GENDERS]
        self.graphs = tuple(variant(f"{self.kind} {BITS}", graph) for graph in scored)
        self._kept = CompiledNetworks(compiled)
        self._read_from: list[KeptNetwork] = []
        self._identity = (
            __version__,
            sha256_of(Path(openvino_network.__file__)),
            version(),
            self._core.get_property(DEVICE, "FULL_DEVICE_NAME"),
            tuple(self._core.get_property(DEVICE, "OPTIMIZATION_CAPABILITIES")),
        )
        self._is_scoring = False
        self._compiled: dict[tuple[str, int, int, bool], openvino.CompiledModel] = {}
        self._compiling = threading.Lock()
        self._requests = threading.local()
        self._partitioner = RowPartitioner(threads)
        self.batch_sizes = batch_sizes(self._partitioner.count)

    @property
    def single_threaded(self) -> "OpenVinoEngine":
        """See `Engine`."""
        other = copy(self)
        other._partitioner = RowPartitioner(1)
        other.batch_sizes = batch_sizes(1)
        return other

    @property
    def scoring(self) -> "OpenVinoEngine":
        """See `Engine`. Its networks for one candidate are others: they are compiled when used."""
        other = copy(self)
        other._is_scoring = True
        return other

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        """Steps all rows; see `Engine`. A size that has not been warmed is compiled first (1 s).

        Rows are padded to `SIZES`: networks of these give the same bits, that of a single row, or
        of any number of rows, does not.
        """
        return self._partitioner.parted(partial(self._run, gender), inputs, ends(len(inputs.goal)))

    def _run(self, gender: str, inputs: StepInputs) -> StepOutputs:
        rows, candidates = inputs.noise.shape[:2]
        padded = pad(inputs, SIZES)
        is_scored = self._is_scoring or candidates > 1
        request = self._request(gender, len(padded.goal), candidates, is_scored)
        request.infer({name: getattr(padded, name) for name in INPUTS}, share_inputs=True)
        # Copies: the next call writes into the same arrays.
        found = {
            name: request.get_tensor(name).data[:rows].copy()
            for name in OUTPUTS
            if is_scored or name not in LEFT_OUT
        }
        return StepOutputs(**(found if is_scored else found | unscored(rows)))

    def _request(self, *key: Any) -> "openvino.InferRequest":
        """The inference request of the calling thread."""
        requests = vars(self._requests)
        name = repr(key)
        if name not in requests:
            with self._compiling:
                if key not in self._compiled:
                    self._compiled[key] = self._compile(*key)
            requests[name] = self._compiled[key].create_infer_request()
        return cast("openvino.InferRequest", requests[name])

    def _compile(
        self, gender: str, rows: int, candidates: int, is_scored: bool
    ) -> "openvino.CompiledModel":
        options: dict[str, Any] = {
            "INFERENCE_PRECISION_HINT": "f32",  # except where the network states it
            "NUM_STREAMS": self._partitioner.count,  # each of one thread
            "INFERENCE_NUM_THREADS": self._partitioner.count,
            "ENABLE_CPU_PINNING": False,  # the event loop needs the cores, too
        }
        kind = "step" if is_scored else "unscored"
        path = self._models.graph(kind, gender, SEED_FRAMES)
        make = partial(self._made, path, rows, candidates, options)
        # A thread inherits the priority of its maker.
        with ThreadPoolExecutor(1, initializer=give_way) as pool:
            return pool.submit(make).result()

    def _made(
        self, path: Path, rows: int, candidates: int, options: dict[str, Any]
    ) -> "openvino.CompiledModel":
        """The network, read from its file or compiled; both let Python run meanwhile."""
        about = (self._identity, self.kind, sha256_of(path), rows, candidates, options)
        if (kept := self._kept.find(*about)) and (found := self._imported(kept, options)):
            return found
        compiled = self._core.compile_model(self._read(path, rows, candidates), DEVICE, options)
        kept = self._kept.keep(compiled.export_model().getvalue(), *about)
        # A freshly compiled one takes 20 MB more than the same one from a file.
        return (kept and self._imported(kept, options)) or compiled

    def _imported(
        self, kept: KeptNetwork, options: dict[str, Any]
    ) -> "openvino.CompiledModel | None":
        from openvino import Tensor

        try:
            tensor = Tensor(kept.body, shared_memory=True)
            found = self._core.import_model(tensor, DEVICE, options)
        except RuntimeError as error:
            log.warning("a kept network cannot be used, and is compiled", error=str(error))
            return None
        kept.release()  # weights are held in another order
        self._read_from.append(kept)
        return found

    def _read(self, path: Path, rows: int, candidates: int) -> "openvino.Model":
        """The step graph in `path` for this number of rows."""
        try:
            network = self._core.read_model(path)
        except RuntimeError as error:
            raise ArtifactError(f"{path}: OpenVINO cannot read it: {error}") from None
        if self.bfloat16:
            network = with_hidden_bfloat16(network)
        shapes = {}
        for tensor in network.inputs:
            shape = tensor.get_partial_shape()
            shape[0] = rows
            if tensor.any_name == "noise":
                shape[1] = candidates
            shapes[tensor] = shape
        network.reshape(shapes)
        return network


def batch_sizes(threads: int) -> tuple[int, ...]:
    """Batch sizes: up to 128 rows per thread, plus a few times 16, so that few rows are padding."""
    small, large = SIZES
    return tuple(
        large * many + few
        for many in range(threads + 1)
        for few in range(0, MOST + 1, small)
        if many + few
    )


def ends(rows: int) -> list[int]:
    """Ends of the parts of `rows`: parts of 128 as long as that pays, then of 16."""
    small, large = SIZES
    found = list(range(large, rows + 1, large))
    rest = rows - (found[-1] if found else 0)
    if rest > MOST:
        return [*found, rows]
    return [*found, *(min(rows - rest + end, rows) for end in range(small, rest + small, small))]


def version() -> str:
    """The version of OpenVINO."""
    from openvino import get_version

    return str(get_version())


def open_core() -> "openvino.Core":
    """Opens OpenVINO. Raises InvalidArgument where it is not installed."""
    try:
        from openvino import Core
    except ImportError as error:
        raise InvalidArgument(
            f"the engine 'openvino' is not installed ({error}); in the repository's "
            "root: pip install '.[openvino]'",
            "engine",
        ) from None
    core = Core()
    if accepts(core, UNFUSED):
        core.set_property(DEVICE, UNFUSED)
    return core


def accepts(core: "openvino.Core", options: dict[str, Any]) -> bool:
    """Whether this version compiles with these options."""
    from openvino import Model
    from openvino import opset13 as ops

    value = ops.parameter([1], np.float32)
    try:
        core.compile_model(Model([ops.relu(value)], [value]), DEVICE, options)
    except RuntimeError:
        return False
    return True
