"""The engine on onnxruntime: one session per gender, on the CPU."""

import time
from collections.abc import Callable, Iterable
from dataclasses import fields
from functools import cached_property

import numpy as np
import onnxruntime

from wayfarer.artifacts import ModelFolder, open_session, sha256_of
from wayfarer.errors import ArtifactError
from wayfarer.runtime.engines.engine import StepInputs, StepOutputs
from wayfarer.spec import BETAS, GENDERS, LATENT, MARKERS, POSED_JOINTS, SEED_FRAMES
from wayfarer.terms import TERMS

INPUTS = tuple(f.name for f in fields(StepInputs))
OUTPUTS = tuple(f.name for f in fields(StepOutputs))


class OnnxEngine:
    """Runs a model folder's step graphs. Implements `Engine`."""

    term_names: tuple[str, ...] = TERMS

    def __init__(self, models: ModelFolder, threads: int = 0) -> None:
        """`threads` per call; 0: one per core. Raises ArtifactError."""
        self.name = models.path.resolve().name
        self._models = models
        self.graphs = tuple(sha256_of(models.graph("step", g, SEED_FRAMES)) for g in GENDERS)
        self._sessions = {g: self._open(models, g, threads) for g in GENDERS}

    @cached_property
    def alone(self) -> "OnnxEngine":
        """See `Engine`. Opened when it is first asked for."""
        return OnnxEngine(self._models, threads=1)

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        """Step all rows; see `Engine`."""
        feeds = {name: getattr(inputs, name) for name in INPUTS}
        return StepOutputs(*self._sessions[gender].run(OUTPUTS, feeds))

    def warm_up(
        self,
        batch_sizes: Iterable[int],
        candidates: Iterable[int],
        done: Callable[[int, int, float], None] = lambda agents, candidates, seconds: None,
    ) -> None:
        """Run every size once, largest first, so that no later call has to allocate.

        `done(agents, candidates, seconds)` is told of each.
        """
        for count in sorted(set(candidates), reverse=True):
            for size in sorted(set(batch_sizes), reverse=True):
                started = time.perf_counter()
                for gender in GENDERS:
                    self.step(gender, resting_inputs(size, count))
                done(size, count, (time.perf_counter() - started) / len(GENDERS))

    @staticmethod
    def _open(models: ModelFolder, gender: str, threads: int) -> onnxruntime.InferenceSession:
        path = models.graph("step", gender, SEED_FRAMES)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        # Idle workers would spin on the cores that the event loop needs to send.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        session = open_session(path, options)
        for kind, found, expected in (
            ("inputs", [i.name for i in session.get_inputs()], INPUTS),
            ("outputs", [o.name for o in session.get_outputs()], OUTPUTS),
        ):
            if set(found) != set(expected):
                raise ArtifactError(f"{path}: {kind}: found {found}, expected {list(expected)}")
        return session


def resting_inputs(agents: int, candidates: int) -> StepInputs:
    """Inputs of the right shapes and of no meaning, for warm-up and benchmarks."""
    rotations = np.zeros((agents, SEED_FRAMES, POSED_JOINTS, 4), np.float32)
    rotations[..., 3] = 1.0
    return StepInputs(
        seed_markers=np.zeros((agents, SEED_FRAMES, MARKERS, 3), np.float32),
        seed_translation=np.zeros((agents, SEED_FRAMES, 3), np.float32),
        seed_rotations=rotations,
        betas=np.zeros((agents, BETAS), np.float32),
        goal=np.zeros((agents, 3), np.float32),
        target_speed=np.zeros(agents, np.float32),
        facing=np.zeros((agents, 2), np.float32),
        term_weights=np.zeros((agents, len(TERMS)), np.float32),
        policy=np.zeros(agents, np.float32),
        noise=np.zeros((agents, candidates, LATENT), np.float32),
    )
