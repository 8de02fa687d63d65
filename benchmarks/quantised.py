"""The time that int8 saves, and its errors.

    python -m benchmarks.quantised [--json FILE] [--quick]

A crowd walks in lock-step on the shipped model in float32, and inputs of its steps are kept. With
those of one crowd the step graphs are made into int8 ones: the products of the networks with their
weights, the latter with a scale for each channel. With those of another crowd, variants are
compared with float32. Nothing of it is served; the graphs lie in a temporary folder.

The scales of the weights' factors are fixed beforehand ("static"). Dynamic scales from the actual
numbers would be more exact, but would depend on the whole batch: a row would depend on the others,
and a log could not be replayed.

One step from equal inputs, all agents, frames, markers and joints; the columns of a row:

  us_per_agent   shortest call on one thread, with the number of agents that suits the engine
  of_float32     this as a share of onnxruntime's in float32
  markers_mm_…   distance of the next seed's markers from those of float32
  rotation_deg_… angle of joints from those of float32
  hips_mm_…      distance of the hips from those of float32
  own_rows       whether a row is the same in any batch, bit for bit

A minute or two, less than one with --quick. Time is that of the processor.
"""

import logging
import sys
import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Final

import numpy as np
import onnx
import onnxruntime
from numpy.typing import NDArray
from onnx import helper
from onnxruntime.quantization import CalibrationDataReader, QuantType, quantize_static

from benchmarks import bench
from benchmarks.bench import Row
from benchmarks.flops import PRODUCTS
from benchmarks.models import ENGINES, GENDER
from wayfarer.body.library import SHIPPED, load_body
from wayfarer.engines.engine import Engine, Float, StepInputs, StepOutputs
from wayfarer.engines.onnx_engine import INPUTS, OnnxEngine
from wayfarer.engines.openvino_engine import OpenVinoEngine
from wayfarer.engines.padding import pick
from wayfarer.engines.warm import WarmEngine
from wayfarer.models.artifacts import ModelFolder
from wayfarer.models.bundle import DEFAULT_MODEL, ModelBundle, load_models
from wayfarer.spec import GENDERS, SEED_FRAMES, STEP_SECONDS
from wayfarer.world.agents.agent import AgentSpec, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.steering import Steering

INT8: Final[Mapping[str, tuple[str, ...]]] = {
    "int8, policy only": ("policy",),
    "int8, all networks": ("policy", "predictor", "regressor"),
}
"""Variants, and the networks whose products they compute in int8, as their weights' names begin."""

FLOAT32: Final = "onnxruntime float32"

ROWS: Final = 64  # agents of one gender, stepped together: the size that suits onnxruntime
REACH: Final = 6.0  # metres from the middle, in x and in y, of goals
NEW_GOALS: Final = 0.05  # share of agents that get one at each step: each every four seconds
OWN: Final = (1, 3, 8, 24)  # rows of batches in which a row must be the same as among all

Inputs = Mapping[str, Sequence[StepInputs]]  # of calls, by gender
Feed = dict[str, Float]  # a call's inputs by name
Numbers = NDArray[np.float64]


class Recorder(OnnxEngine):
    """Keeps the inputs of whole calls. Implements `WarmEngine`."""

    def __init__(self, models: ModelFolder) -> None:
        super().__init__(models, threads=1)
        self.kept: dict[str, list[StepInputs]] = {gender: [] for gender in GENDERS}

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        """Implements `Engine`."""
        if len(inputs.goal) == ROWS:
            self.kept[gender].append(inputs)
        return super().step(gender, inputs)


def recorded(models: ModelFolder, seed: int, steps: int, every: int) -> Inputs:
    """Inputs of some steps of a crowd that gets goals now and then."""
    engine, random = Recorder(models), np.random.default_rng(seed)
    bodies = {gender: load_body(SHIPPED, gender, "low") for gender in GENDERS}
    genders = GENDERS * ROWS
    world = ModelBundle(models, engine, bodies).world(
        len(genders), Steering().with_search(candidates=1)
    )
    specs = [AgentSpec(gender=g, noise_seed=int(random.integers(2**31))) for g in genders]
    session = world.create_session(SessionSpec(avoid=False), 0.0)
    crowd = world.create_agents(session.session_id, specs, 0.0)
    for step in range(steps):
        now = step * STEP_SECONDS
        for agent in crowd:
            if step == 0 or random.random() < NEW_GOALS:
                x, y = random.uniform(-REACH, REACH, 2).tolist()
                world.give(agent.agent_id, Goal((x, y, 0.0)), now)
        for _ in world.advance(now + STEP_SECONDS):
            pass
    return {gender: calls[every::every] for gender, calls in engine.kept.items()}


def products_of(graph: onnx.GraphProto, networks: Collection[str]) -> set[str]:
    """Names of a graph's products with these networks' weights, converted, turned, cut or not."""
    constants = {tensor.name for tensor in graph.initializer}
    origins: dict[str, set[str]] = {}  # inputs and constants of the graph that a value is made of
    found = set()
    for node in graph.node:
        made_of = [origins.get(name, {name}) for name in node.input if name]
        weights = made_of[1] if node.op_type in PRODUCTS else set()
        if weights <= constants and any(name.split(".")[0] in networks for name in weights):
            found.add(node.name)
        origins |= dict.fromkeys(node.output, set().union(*made_of))
    return found


def fold(graph: Path, target: Path) -> None:
    """Writes a graph whose weights are ready for their products, as the quantiser requires."""
    options = onnxruntime.SessionOptions()
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC
    options.optimized_model_filepath = str(target)
    external = "session.optimized_model_external_initializers_"
    options.add_session_config_entry(f"{external}file_name", f"{target.stem}.bin")
    options.add_session_config_entry(f"{external}min_size_in_bytes", "1024")
    # The one left out would give products other names.
    onnxruntime.InferenceSession(
        str(graph), options, ["CPUExecutionProvider"], disabled_optimizers=["GemmTransposeFusion"]
    )


def with_sums_apart(model: onnx.ModelProto) -> onnx.ModelProto:
    """The same, changed in place: a `Gemm` adds only constants; other terms are added after it.

    onnxruntime has no int8 product that adds computed values: it would make the weights float32
    again in every call, which saves nothing and gives a lone row other bits.
    """
    constants = {tensor.name for tensor in model.graph.initializer}
    nodes: list[onnx.NodeProto] = []
    for node in model.graph.node:
        nodes.append(node)
        added = node.input[2] if node.op_type == "Gemm" and len(node.input) == 3 else ""
        if added and added not in constants:
            del node.input[2]
            result, node.output[0] = node.output[0], f"{node.output[0]}.product"
            nodes.append(helper.make_node("Add", [node.output[0], added], [result]))
    del model.graph.node[:]
    model.graph.node.extend(nodes)
    return model


class Calls(CalibrationDataReader):
    """Inputs of calls, as the quantiser wants them: one by one, and None at the end."""

    def __init__(self, calls: Iterable[Feed]) -> None:
        self._calls = iter(calls)

    def get_next(self) -> Feed | None:
        """The next inputs by name."""
        return next(self._calls, None)


def quantise(graph: Path, target: Path, networks: Collection[str], calls: Iterable[Feed]) -> None:
    """Writes a graph with products of these networks in int8, with scales that fit the calls."""
    products = products_of(onnx.load(graph, load_external_data=False).graph, networks)
    folded = target.with_name(f"folded_{graph.name}")
    fold(graph, folded)
    onnx.save(with_sums_apart(onnx.load(folded)), folded)
    quantize_static(
        folded,
        target,
        Calls(calls),
        op_types_to_quantize=PRODUCTS,  # otherwise the ranges of all other values are taken, too
        per_channel=True,
        activation_type=QuantType.QUInt8,
        nodes_to_quantize=sorted(products),
    )


def distances(expected: StepOutputs, found: StepOutputs) -> tuple[Numbers, Numbers, Numbers]:
    """Distances of all markers in millimetres, rotations in degrees, and hips in millimetres."""
    markers = _lengths(found.next_seed_markers, expected.next_seed_markers)
    one, other = found.rotations, expected.rotations
    # q and -q are the same rotation. Not by the cosine: in float32 it hides angles below 0.04°.
    apart = np.minimum(_lengths(one, other), _lengths(one, -other))
    turned = np.degrees(4 * np.arcsin(np.minimum(apart / 2, 1)))
    return 1e3 * markers, turned, 1e3 * _lengths(found.translation, expected.translation)


def _lengths(one: Float, other: Float) -> Numbers:
    return np.linalg.norm(one.astype(np.float64) - other, axis=-1).ravel()


def error_columns(pairs: Iterable[tuple[StepOutputs, StepOutputs]]) -> Row:
    """Error columns for pairs of float32 outputs and a variant's, on the same inputs."""
    each = zip(*(distances(*pair) for pair in pairs), strict=True)
    markers, turned, hips = (np.concatenate(calls) for calls in each)
    return {
        "markers_mm_median": float(np.median(markers)),
        "markers_mm_p99": float(np.percentile(markers, 99)),
        "markers_mm_max": float(markers.max()),
        "rotation_deg_p99": float(np.percentile(turned, 99)),
        "hips_mm_p99": float(np.percentile(hips, 99)),
    }


def has_own_rows(engine: Engine, gender: str, inputs: StepInputs) -> bool:
    """Whether rows in smaller batches are those of the whole one, bit for bit."""
    whole, number = engine.step(gender, inputs), np.arange(len(inputs.goal))
    batches = (number[start : start + size] for size in OWN for start in number[::size])
    # Copies: a view would keep its rows where they were in memory.
    pairs = ((pick(whole, rows), engine.step(gender, pick(inputs, rows))) for rows in batches)
    return all(
        np.array_equal(getattr(one, field.name), getattr(other, field.name))
        for one, other in pairs
        for field in fields(StepOutputs)
    )


def seconds_each(engines: Mapping[str, WarmEngine], inputs: StepInputs, rounds: int) -> Row:
    """Seconds per agent in the shortest call of each engine, at its best size; they take turns."""
    clock, found = bench.clock_of(threads=1), dict.fromkeys(engines, float("inf"))
    for turn in range(rounds + 1):
        for name, engine in engines.items():
            batch = pick(inputs, np.arange(engine.full) % len(inputs.goal))
            started = clock()
            engine.step(GENDER, batch)
            if turn:  # the first allocates
                found[name] = min(found[name], clock() - started)
    return {name: seconds / engines[name].full for name, seconds in found.items()}


def rows_of(engines: Mapping[str, WarmEngine], compared: Inputs, rounds: int) -> Iterator[Row]:
    """A row for each variant, compared with FLOAT32."""
    seconds = seconds_each(engines, compared[GENDER][0], rounds)
    calls = [(gender, inputs) for gender in GENDERS for inputs in compared[gender]]
    expected = [engines[FLOAT32].step(*call) for call in calls]
    for name, engine in engines.items():
        print(f"{name}: comparing {len(calls)} calls", file=sys.stderr)
        found = (engine.step(*call) for call in calls)
        yield {
            "variant": name,
            "batch": engine.full,
            "us_per_agent": seconds[name] * 1e6,
            "of_float32": seconds[name] / seconds[FLOAT32],
            **error_columns(zip(expected, found, strict=True)),
            "own_rows": all(has_own_rows(engine, g, compared[g][0]) for g in GENDERS),
        }


def ratios(rows: Sequence[Row]) -> dict[str, Row]:
    """Figures to compare between runs."""
    return {
        f"{row['variant']}: time / float32": bench.ratio(row["of_float32"], "lower")
        for row in rows
        if row["variant"] != FLOAT32
    }


def opened(models: ModelFolder, calibration: Inputs, folder: Path) -> dict[str, WarmEngine]:
    """All variants, by name; the graphs of those in int8 are put into the folder."""
    engines: dict[str, WarmEngine] = {FLOAT32: OnnxEngine(models, threads=1)}
    for name, networks in INT8.items():
        print(f"{name}: quantising", file=sys.stderr)
        own = folder / name
        own.mkdir()
        for gender in GENDERS:
            graph = models.graph("step", gender, SEED_FRAMES)
            calls = ({each: getattr(c, each) for each in INPUTS} for c in calibration[gender])
            quantise(graph, own / graph.name, networks, calls)
        engines[name] = OnnxEngine(replace(models, path=own), threads=1)
    if "openvino" in ENGINES:
        other = OpenVinoEngine(models, threads=1)
        engines[f"openvino {'bfloat16' if other.bfloat16 else 'float32'}"] = other
    return engines


def main() -> None:
    """Record, quantise, measure, and print."""
    asked = bench.parser(__doc__).parse_args()
    # Its advice, and onnxruntime's on graphs that are not for serving.
    logging.getLogger().setLevel(logging.ERROR)
    onnxruntime.set_default_logger_severity(3)
    steps, every, rounds = (40, 5, 40) if asked.quick else (200, 10, 200)
    models = load_models(DEFAULT_MODEL)
    print(f"recording {steps} steps of two crowds", file=sys.stderr)
    calibration, compared = (recorded(models, seed, steps, every) for seed in (1, 2))
    with tempfile.TemporaryDirectory() as folder:
        engines = opened(models, calibration, Path(folder))
        rows = list(rows_of(engines, compared, rounds))
    bench.finish(asked, rows, ratios=ratios(rows))


if __name__ == "__main__":
    main()
