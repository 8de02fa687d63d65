"""The engine on onnxruntime: one session per gender, on the CPU."""

import threading
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import fields
from functools import cache
from typing import Final

import onnxruntime

from wayfarer.engines.engine import LEFT_OUT, EngineKind, StepInputs, StepOutputs, unscored
from wayfarer.engines.row_partitioner import LEAST, RowPartitioner
from wayfarer.engines.warm import WarmEngine
from wayfarer.errors import ArtifactError
from wayfarer.models.artifacts import ModelFolder, open_session, sha256_of
from wayfarer.spec import GENDERS, SEED_FRAMES
from wayfarer.terms import TERMS

INPUTS = tuple(f.name for f in fields(StepInputs))
OUTPUTS = tuple(f.name for f in fields(StepOutputs))
UNSCORED: Final = tuple(name for name in OUTPUTS if name not in LEFT_OUT)

SIZES: Final = (1, 2, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96)
"""Rows for one thread. A row costs half as much in a batch of 64 as in one of 8. With 96 it is 4 %
less, and the motion thread has fewer batches; larger ones keep the others waiting. Few sizes:
memory is allocated for each."""

MAX_ROWS, MAX_CANDIDATES = 128, 512
"""Rows that one thread computes at a time: more do not fit its cache and cost a fifth more."""


class OnnxEngine(WarmEngine):
    """Runs a model folder's step graphs. Implements `WarmEngine`."""

    setting: EngineKind = "onnxruntime"
    kind = "onnxruntime"
    to_compile = ()
    term_names: tuple[str, ...] = TERMS

    def __init__(self, models: ModelFolder, threads: int = 0) -> None:
        """`threads` per call; 0: one per core. Raises ArtifactError."""
        self._models = models
        self.name = models.path.resolve().name
        self.graphs = tuple(sha256_of(models.graph("step", g, SEED_FRAMES)) for g in GENDERS)
        with ThreadPoolExecutor(len(GENDERS)) as pool:
            opened = pool.map(self._open, GENDERS)
            self._sessions = dict(zip(GENDERS, opened, strict=True))
        self._scores = False  # whether the caller relies on them
        self._opening = threading.Lock()
        self._partitioner = RowPartitioner(threads)
        self.batch_sizes = self._partitioner.sizes(SIZES)
        self.full = self.batch_sizes[-1]  # 96 on two threads cost a seventh more: 48 for each

    @property
    def single_threaded(self) -> "OnnxEngine":
        """See `Engine`."""
        other = copy(self)
        other._partitioner = RowPartitioner(1)
        other.batch_sizes, other.full = SIZES, SIZES[-1]
        return other

    @property
    def scoring(self) -> "OnnxEngine":
        """See `Engine`."""
        other = copy(self)
        other._scores = True
        return other

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        """Steps all rows; see `Engine`."""
        candidates = inputs.noise.shape[1]
        outputs = UNSCORED
        if self._scores or candidates > 1:
            outputs = OUTPUTS
            self._open_scored(gender)
        session, _ = self._sessions[gender]

        def run(rows: StepInputs) -> StepOutputs:
            found = session.run(outputs, {n: getattr(rows, n) for n in INPUTS})
            return StepOutputs(**unscored(len(rows.goal)) | dict(zip(outputs, found, strict=True)))

        most = min(MAX_ROWS, max(MAX_CANDIDATES // candidates, LEAST))
        return self._partitioner.step(run, inputs, most)

    def _open_scored(self, gender: str) -> None:
        """Its session takes the place of the one without scores, so that memory holds one."""
        with self._opening:
            if self._sessions[gender][1] != OUTPUTS:
                self._sessions[gender] = self._open(gender, OUTPUTS)

    def _open(
        self, gender: str, outputs: tuple[str, ...] = UNSCORED
    ) -> tuple[onnxruntime.InferenceSession, tuple[str, ...]]:
        """A session and its outputs."""
        kind = "step" if outputs == OUTPUTS else "unscored"
        path = self._models.graph(kind, gender, SEED_FRAMES)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1  # see row_partitioner.py
        share_arena()
        options.add_session_config_entry("session.use_env_allocators", "1")
        session = open_session(path, options)
        for names, found, expected in (
            ("inputs", [i.name for i in session.get_inputs()], INPUTS),
            ("outputs", [o.name for o in session.get_outputs()], outputs),
        ):
            if set(found) != set(expected):
                raise ArtifactError(f"{path}: {names}: found {found}, expected {list(expected)}")
        return session, outputs


@cache
def share_arena() -> None:
    """All sessions take the memory of their calls from one arena, which keeps it. An arena of each
    would keep the most that any of its calls has taken; the heap would mix it with other arrays.
    """
    kind, purpose = onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR, onnxruntime.OrtMemType.DEFAULT
    memory = onnxruntime.OrtMemoryInfo("Cpu", kind, 0, purpose)
    onnxruntime.create_and_register_allocator(memory, None)
