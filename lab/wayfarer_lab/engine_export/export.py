"""Writes the folder for game engines, checked: nothing is left behind when a check fails."""

import json
import shutil
import tempfile
from collections.abc import Callable
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnx
import onnxruntime
from numpy.typing import NDArray

from wayfarer.engines.engine import Engine
from wayfarer.engines.onnx_engine import OnnxEngine
from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer.models.artifacts import ModelFolder, open_session, sha256_of
from wayfarer.models.bundle import START_POSES, Bodies, load_bodies, load_models
from wayfarer.spec import GENDERS, SEED_FRAMES
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal, goal_columns
from wayfarer.world.agents.slots import Mode, Motion, Seeds
from wayfarer.world.agents.spawn import Spawner, load_start_poses
from wayfarer.world.agents.style import style_of
from wayfarer.world.goals.steering import Steering
from wayfarer.world.stepping.batch import assemble
from wayfarer_lab.engine_export.bodies import body_parts
from wayfarer_lab.engine_export.graph import engine_graph
from wayfarer_lab.engine_export.operators import check_operators
from wayfarer_lab.engine_export.sidecar import PAGE, SIDECAR, body_file_name, page, sidecar
from wayfarer_lab.engine_export.weights import FLOATS_FILE, HALVES_FILE, SharedWeights

TOLERANCE: Final = 1e-4
"""Largest difference from the served engine in one step: metres, and components of quaternions."""

MAX_CANDIDATES: Final = 16

STEPS: Final = 12
"""Steps of the walk on which graphs are compared."""

Report = Callable[[str], None]


def export_for_engines(
    models: Path, out: Path, candidates: int, report: Report, halves: bool = False
) -> None:
    """Writes graphs, bodies, sidecar and page of a model folder to `out`.

    `report` receives lines of progress.
    With `halves` the graphs share `halves.bin`, float16, for pages that load both: the same
    numbers in a third of the bytes. See `weights.py`.

    An earlier export in `out` is replaced file by file, and what else is there stays (Unity keeps
    its .meta files beside each file). Raises InvalidArgument, ArtifactError.
    """
    if not 1 <= candidates <= MAX_CANDIDATES:
        raise InvalidArgument(
            f"{candidates} candidates; allowed: 1 to {MAX_CANDIDATES}", "candidates"
        )
    _check_place(out)
    report(f"reading {models}")
    folder = load_models(models)
    bodies, poses = load_bodies(folder.body), load_start_poses(START_POSES)
    try:
        out.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(prefix=".export.", dir=out))
    except OSError as error:
        raise InvalidArgument(f"{out} cannot be written: {error.strerror}", "out") from error
    try:
        _write(staging, folder, bodies, poses, candidates, report, halves)
        for file in staging.iterdir():
            file.replace(out / file.name)
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _write(
    out: Path,
    folder: ModelFolder,
    bodies: Bodies,
    poses: NDArray[np.float32],
    candidates: int,
    report: Report,
    halves: bool,
) -> None:
    graphs, parts, differences = {}, {}, {}
    meanings = {}
    store = SharedWeights() if halves else None
    engines = _served(folder)
    steering = Steering().with_search(candidates=candidates)
    for gender in GENDERS:
        source = folder.graph("step", gender, SEED_FRAMES)
        file = out / graph_file(gender)
        about = {
            "model": folder.name,
            "gender": gender,
            "candidates": candidates,
            "source_sha256": sha256_of(source),
        }
        graphs[gender] = graph = engine_graph(source, candidates, about)
        onnx.checker.check_model(graph, full_check=True)
        check_operators(graph, file.name)
        written = onnx.ModelProto.FromString(graph.SerializeToString())
        if store is not None:
            store.take(written)
        file.write_bytes(written.SerializeToString())
        report(f"{file.name}: {len(graph.graph.node)} nodes, {file.stat().st_size / 1e6:.1f} MB")
        parts[gender] = body_parts(bodies[gender], poses)
        (out / body_file_name(gender)).write_bytes(
            b"".join(p.values.tobytes() for p in parts[gender])
        )
        meanings[file.name] = f"the step of {gender} people"
        meanings[body_file_name(gender)] = f"{gender} body: bones, start poses, soles"
    if store is not None:
        store.write(out)
        meanings[HALVES_FILE] = f"weights of both graphs, float16; they read them as {FLOATS_FILE}"
    for gender in GENDERS:
        walk = _Walk(bodies, poses, gender, steering, candidates)
        for name, engine in engines.items():
            worst = walk.compared(out / graph_file(gender), engine)
            differences[f"{gender}, {name}"] = worst
            report(f"{graph_file(gender)}: differs from {name} by {worst:.1e} at most")
    (out / FLOATS_FILE).unlink(missing_ok=True)
    files = {
        name: {
            "bytes": (out / name).stat().st_size,
            "sha256": sha256((out / name).read_bytes()).hexdigest(),
            "meaning": meaning,
        }
        for name, meaning in meanings.items()
    }
    described = sidecar(
        model=folder.name,
        graphs=graphs,
        bodies=bodies,
        parts=parts,
        files=files,
        candidates=candidates,
        differences=differences,
        steering=steering,
    )
    text = json.dumps(described, indent=1, ensure_ascii=False) + "\n"
    (out / SIDECAR).write_text(text, "utf-8")
    (out / PAGE).write_text(page(described), "utf-8")


def _check_place(out: Path) -> None:
    """Raises InvalidArgument where somebody's files would be overwritten."""
    if out.exists() and not out.is_dir():
        raise InvalidArgument(f"{out} is a file; name a folder to write", "out")
    if (out / SIDECAR).is_file():
        return
    written = [
        SIDECAR,
        PAGE,
        HALVES_FILE,
        *(name(g) for g in GENDERS for name in (graph_file, body_file_name)),
    ]
    if taken := [name for name in written if (out / name).exists()]:
        raise InvalidArgument(
            f"{out} holds {', '.join(taken)}, and no earlier export; name another folder", "out"
        )


def graph_file(gender: str) -> str:
    """File of a gender's graph."""
    return f"step_{gender}.onnx"


def _served(folder: ModelFolder) -> dict[str, Engine]:
    """The server's engines: onnxruntime and, if it is installed, torch on the CPU."""
    engines: dict[str, Engine] = {"onnxruntime": OnnxEngine(folder, threads=1)}
    if find_spec("torch") is not None:
        from wayfarer.engines.torch.engine import TorchEngine, load_networks

        engines["torch"] = TorchEngine(load_networks(folder, "cpu"))
    return engines


class _Walk:
    """Some people who set off from all start poses, walk and stop, as inputs step by step."""

    def __init__(
        self,
        bodies: Bodies,
        poses: NDArray[np.float32],
        gender: str,
        steering: Steering,
        candidates: int,
    ) -> None:
        generator = np.random.default_rng(0)
        spawner, count = Spawner(bodies, poses), len(poses)
        self._gender, self._steering = gender, steering
        self._betas = generator.normal(size=(count, 10)).clip(-2, 2).astype(np.float32)
        specs = [
            AgentSpec(gender, tuple(map(float, row)), (2.0 * k, 0.0), k % 7, noise_seed=k)
            for k, row in enumerate(self._betas)
        ]
        self._start = Motion.join([spawner.stand(spec) for spec in specs])
        angles = generator.uniform(0, 2 * np.pi, count)
        goals = [
            Goal((2.0 * k + 3 * float(np.cos(a)), 3 * float(np.sin(a)), 0.0))
            for k, a in enumerate(angles)
        ]
        self._goals = goal_columns(goals, (0.0, 0.0))
        self._goals.more[:] = False
        self._noise = generator.normal(size=(STEPS, count, candidates, 128)).astype(np.float32)
        self._style = style_of(np.arange(count, dtype=np.uint64))

    def compared(self, file: Path, engine: Engine) -> float:
        """Largest difference of a file's outputs from an engine's. Raises ArtifactError."""
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        session = open_session(file, options)
        names = [output.name for output in session.get_outputs()]
        seed, gait, worst = self._start.seed, self._start.gait, 0.0
        gait.mode[:] = Mode.WALKING
        for number in range(STEPS):
            if number == STEPS - 3:
                gait.mode[:] = Mode.STOPPING
            inputs = assemble(
                seed,
                self._betas,
                gait,
                self._goals,
                self._noise[number],
                self._style,
                self._steering,
            )
            expected = engine.step(self._gender, inputs)
            feeds = {i.name: getattr(inputs, i.name) for i in session.get_inputs()}
            outputs = dict(zip(names, session.run(names, feeds), strict=True))
            worst = max(worst, self._difference(file.name, engine, outputs, expected))
            seed = Seeds(
                expected.next_seed_markers,
                expected.translation[:, -SEED_FRAMES:],
                expected.rotations[:, -SEED_FRAMES:],
            )
            gait.speed[:] = 1.0
        return worst

    @staticmethod
    def _difference(name: str, engine: Engine, outputs: dict[str, Any], expected: Any) -> float:
        worst = 0.0
        for output, values in outputs.items():
            if output == "contacts":
                continue  # 0 or 1, by thresholds that the last digit may cross
            off = float(np.abs(values - getattr(expected, output)).max())
            if not off <= TOLERANCE:  # a NaN fails too
                raise ArtifactError(
                    f"{name}: {output} differs from {engine.name} by {off:.1e}; "
                    f"allowed {TOLERANCE:.0e}"
                )
            worst = max(worst, off)
        return worst
