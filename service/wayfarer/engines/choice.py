"""Which engine steps the agents: the one asked for, or the faster on this machine."""

import time
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import structlog

from wayfarer.engines.dummy import dummy_inputs
from wayfarer.engines.engine import EngineKind
from wayfarer.engines.onnx_engine import OnnxEngine
from wayfarer.engines.openvino_engine import OpenVinoEngine
from wayfarer.engines.warm import WarmEngine
from wayfarer.errors import InvalidArgument
from wayfarer.models.artifacts import ModelFolder
from wayfarer.spec import GENDERS

log = structlog.get_logger(__name__)

TRIAL: Final = 64
"""Agents of the batch that is timed."""

CALLS: Final = 4
"""Calls that are timed; the shortest counts, since others may have been disturbed."""

GAIN: Final = 0.8
"""Another engine must take less than this share of the default's time: it costs memory, too."""


def open_engine(
    models: ModelFolder,
    kind: EngineKind,
    threads: int,
    candidates: int = 1,
    compiled: Path | None = None,
) -> WarmEngine:
    """`auto` is onnxruntime, unless OpenVINO is installed and clearly faster.

    OpenVINO has a network for every number of candidates up to `candidates` (and every gender and
    size of batch), each of 80 MB: with more than one candidate, `auto` leaves it alone. It keeps
    them in the folder `compiled`, unless that is None.

    Raises InvalidArgument for an engine that is not installed or cannot run here, ArtifactError.
    """
    if kind == "torch":
        return _open_torch(models)
    if kind == "openvino":
        return OpenVinoEngine(models, threads, compiled=compiled)
    default = OnnxEngine(models, threads)
    if kind == "onnxruntime" or candidates > 1 or find_spec("openvino") is None:
        return default
    other = OpenVinoEngine(models, threads, compiled=compiled)
    found = {engine.kind: trial(engine) for engine in (default, other)}
    fastest = other if found[other.kind] < GAIN * found[default.kind] else default
    milliseconds = {name: round(1e3 * seconds, 1) for name, seconds in found.items()}
    log.info("engine chosen", engine=fastest.kind, agents=TRIAL, milliseconds=milliseconds)
    return fastest


def _open_torch(models: ModelFolder) -> WarmEngine:
    # A CPU server has no torch installed; importing it takes seconds.
    try:
        from wayfarer.engines.torch.engine import open_gpu_engine
    except ImportError as error:
        raise InvalidArgument(
            f"the engine 'torch' is not installed ({error}); in the repository's root: "
            "pip install '.[gpu]'",
            "engine",
        ) from None
    return open_gpu_engine(models)


def trial(engine: WarmEngine) -> float:
    """Seconds of the shortest of a few calls."""
    inputs = dummy_inputs(TRIAL, 1)
    engine.step(GENDERS[0], inputs)
    seconds = []
    for _ in range(CALLS):
        started = time.perf_counter()
        engine.step(GENDERS[0], inputs)
        seconds.append(time.perf_counter() - started)
    return min(seconds)
