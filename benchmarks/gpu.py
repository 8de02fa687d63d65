"""Number of agents that one GPU steps, by batch, candidates and precision, with and without host
copies.

    python -m benchmarks.gpu [--precisions float32 tf32 bfloat16] [--candidates 1 8] [--minutes 9]
                             [--model FOLDER] [--json FILE] [--quick]

First the torch engine is compared with onnxruntime, on standing bodies with goals; if they differ,
it ends with 1. Then batches from 64 agents on are doubled until a step takes longer than the 0.2 s
that it covers, or memory runs out; bisection finds the largest batch in time. The columns:

  kept_on    "host": calls of `Engine.step`, inputs and outputs copied from and to arrays in host
             memory; "device": a crowd that stays there, each step beginning where the last ended
  ms         of one step of all agents: the shortest of a few
  of_gemm    ms, as a multiple of what the step's matrix products would take at the speed of large
             ones in the same precision, measured in the same run; but coordinates are always
             multiplied in float32
  memory_mb  maximum of the GPU
  ended_by   what a larger batch would exceed

Without a GPU, only the first part runs, on the CPU. When the time is up, the output lists what was
not measured.
"""

import argparse
import gc
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from functools import partial
from itertools import product
from math import inf
from pathlib import Path
from typing import Final, get_args

import numpy as np
import torch
from tests.engines.standing import standing_inputs

from benchmarks import bench
from benchmarks.bench import Row
from benchmarks.curve import LEAST, Point, curve, ended_by
from benchmarks.device_crowd import DeviceCrowd
from benchmarks.flops import products as products_of
from benchmarks.models import GENDER, step_graph
from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.engines.onnx_engine import OnnxEngine
from wayfarer.engines.torch.engine import Networks, TorchEngine, load_networks
from wayfarer.engines.torch.precision import Precision, products
from wayfarer.models.artifacts import ModelFolder
from wayfarer.models.bundle import DEFAULT_MODEL, load_models
from wayfarer.spec import GENDERS, STEP_SECONDS

PRECISIONS: Final[tuple[Precision, ...]] = get_args(Precision)


@dataclass(frozen=True)
class Tolerance:
    """Largest accepted differences from onnxruntime."""

    difference: float  # of markers and places in metres, and of the numbers of rotations
    same_choice: float  # share of rows: some candidates are almost equally good


ALLOWED: Final[dict[Precision, Tolerance]] = {
    "float32": Tolerance(1e-4, 0.99),
    "tf32": Tolerance(5e-3, 0.9),
    "bfloat16": Tolerance(3e-2, 0.5),
}

LARGE: Final = 8192
"""Side of the matrices whose product is the ceiling."""

Seconds = Callable[[Networks, StepInputs, float], float]


def people(agents: int, candidates: int) -> StepInputs:
    """Bodies, 64 of them different, since zeros would be multiplied faster than numbers."""
    some = standing_inputs(GENDER, min(agents, LEAST), candidates)
    rows = np.arange(agents) % len(some.goal)
    return StepInputs(**{f.name: getattr(some, f.name)[rows] for f in fields(StepInputs)})


def parity(models: ModelFolder, precision: Precision, device: str | None, agents: int) -> Row:
    """Differences of the torch engine from onnxruntime, over both genders."""
    engine = TorchEngine(load_networks(models, device, precision), batch_sizes=(agents,))
    exact = OnnxEngine(models, 1)
    off, alike = [], []
    for gender in GENDERS:
        inputs = standing_inputs(gender, agents, candidates=4)
        found, expected = engine.step(gender, inputs), exact.step(gender, inputs)
        same = found.choice == expected.choice
        alike.append(same)
        off.append(difference(found, expected)[same])
    worst, share = float(np.concatenate(off).max(initial=0)), float(np.concatenate(alike).mean())
    allowed = ALLOWED[precision]
    return {
        "device": device_name(engine.networks.device),
        "precision": precision,
        "rows": agents * len(GENDERS),
        "largest_difference": worst,
        "same_choice": share,
        "agrees": worst <= allowed.difference and share >= allowed.same_choice,
    }


def difference(found: StepOutputs, expected: StepOutputs) -> np.ndarray:
    """The largest of each row's poses and markers."""
    names = ("translation", "rotations", "next_seed_markers")
    return np.stack(
        [
            np.abs(getattr(found, n) - getattr(expected, n)).reshape(len(found.choice), -1).max(1)
            for n in names
        ]
    ).max(0)


def host_seconds(networks: Networks, inputs: StepInputs, spend: float) -> float:
    """Seconds of a call, with copies."""
    engine = TorchEngine(networks, batch_sizes=(len(inputs.goal),))
    return bench.best(lambda: engine.step(GENDER, inputs), spend, time.perf_counter)


def device_seconds(networks: Networks, inputs: StepInputs, spend: float) -> float:
    """Seconds of a step of a crowd that stays on the device."""
    crowd = DeviceCrowd(networks, GENDER, inputs)

    def step() -> None:
        crowd.step()
        crowd.lane.wait()

    return bench.best(step, spend, time.perf_counter)


KEPT_ON: Final[dict[str, Seconds]] = {"device": device_seconds, "host": host_seconds}


@dataclass(frozen=True)
class Case:
    """The settings of one curve."""

    networks: Networks
    candidates: int
    kept_on: str

    @property
    def about(self) -> Row:
        """Columns that all its rows have."""
        return {
            "precision": self.networks.precision,
            "candidates": self.candidates,
            "kept_on": self.kept_on,
        }

    def timed(self, agents: int, spend: float) -> Point:
        """Times a batch on an otherwise empty GPU."""
        gc.collect()
        torch.cuda.empty_cache()
        torch.cuda.reset_peak_memory_stats()
        try:
            inputs = people(agents, self.candidates)
            seconds = KEPT_ON[self.kept_on](self.networks, inputs, spend)
        except RuntimeError as error:
            # A recording that runs out of memory fails once more when it is ended.
            if not any(isinstance(e, torch.OutOfMemoryError) for e in (error, error.__context__)):
                raise
            seconds = inf
        return Point(agents, seconds, torch.cuda.max_memory_allocated())


def ceiling(precision: Precision) -> float:
    """FLOP/s of a product of large matrices."""
    kind = torch.bfloat16 if precision == "bfloat16" else torch.float32
    a, b = (torch.randn(LARGE, LARGE, device="cuda", dtype=kind) for _ in range(2))

    def multiply() -> None:
        a @ b
        torch.cuda.synchronize()

    with products("tf32" if precision == "tf32" else "ieee"):
        return 2 * LARGE**3 / bench.best(multiply, 0.5, time.perf_counter)


def cases(models: ModelFolder, asked: argparse.Namespace) -> Iterator[Case]:
    """Precisions, candidates, and where state is kept."""
    for precision in asked.precisions:
        networks = load_networks(models, precision=precision)
        for candidates, kept_on in product(asked.candidates, KEPT_ON):
            yield Case(networks, candidates, kept_on)


def rows_of(case: Case, points: list[Point], flops: float, ceiling: float) -> list[Row]:
    """A curve; `flops` of an agent's matrix products, and how many of them fit into a second."""
    return [
        case.about
        | {
            "agents": point.agents,
            "ms": point.seconds * 1e3,
            "us_per_agent": point.seconds / point.agents * 1e6,
            "of_gemm": point.seconds * ceiling / flops / point.agents,
            "memory_mb": point.memory / 1e6,
        }
        for point in sorted(points, key=lambda point: point.agents)
        if point.seconds < inf
    ]


def most_of(case: Case, points: list[Point]) -> Row:
    """The end of a curve."""
    held = max((point.agents for point in points if point.in_time), default=None)
    return case.about | {"agents_in_time": held, "ended_by": ended_by(points)}


def flops_of(graph: Path, candidates: int) -> float:
    """Operations of an agent's matrix products in a step."""
    return sum(p.flops for p in products_of(graph, agents=LEAST, candidates=candidates)) / LEAST


def ratios(rows: list[Row]) -> dict[str, Row]:
    """Figures to compare between runs: a crowd's largest batch in time, against its products."""
    found: dict[str, Row] = {}
    for row in rows:
        if row["kept_on"] == "device" and row["ms"] <= STEP_SECONDS * 1e3:
            name = f"GPU {row['precision']} K={row['candidates']}: step / GEMM"
            found[name] = bench.ratio(row["of_gemm"], "lower")
    return found


def throughput(models: ModelFolder, asked: argparse.Namespace, until: float) -> Row:
    """Rows of all curves, their ends, and the ceilings."""
    spend = 0.1 if asked.quick else 0.4
    ceilings = {precision: ceiling(precision) for precision in asked.precisions}
    flops = {k: flops_of(step_graph(models.path), k) for k in asked.candidates}
    rows, most = [], []
    for case in cases(models, asked):
        points = list(curve(partial(case.timed, spend=spend), until))
        precision = case.networks.precision
        rows += rows_of(case, points, flops[case.candidates], ceilings[precision])
        most.append(most_of(case, points))
        bench.show(most[-1:])
    gemm = [{"precision": p, "side": LARGE, "tflops": c / 1e12} for p, c in ceilings.items()]
    return {"rows": most + rows, "gemm": gemm, "ratios": ratios(rows)}


def device_name(device: torch.device) -> str:
    """The maker's name of a GPU."""
    return torch.cuda.get_device_name(device) if device.type == "cuda" else "CPU"


def main() -> int:
    """Compare, measure, and print; 1 when the engines differ."""
    parser = bench.parser(__doc__)
    parser.add_argument("--precisions", nargs="+", choices=PRECISIONS, default=PRECISIONS)
    parser.add_argument("--candidates", type=int, nargs="+", default=(1, 8))
    parser.add_argument("--minutes", type=float, default=9.0, help="after which nothing is begun")
    parser.add_argument("--model", type=Path, default=DEFAULT_MODEL)
    asked = parser.parse_args()
    until = time.monotonic() + 60 * asked.minutes
    models = load_models(asked.model)
    on_gpu = torch.cuda.is_available()
    device, agents = (None, 256) if on_gpu else ("cpu", 8)
    compared = [parity(models, precision, device, agents) for precision in asked.precisions]
    wrong = [row["precision"] for row in compared if not row["agrees"]]
    if wrong:
        bench.finish(asked, compared)
        print(f"{', '.join(wrong)}: other motion than onnxruntime's; nothing is measured")
        return 1
    if not on_gpu:
        bench.finish(asked, compared, device=None)
        print("torch finds no GPU here: throughput is not measured")
        return 0
    found = throughput(models, asked, until)
    bench.show(found["gemm"])
    name = device_name(torch.device("cuda"))
    bench.finish(asked, compared + found.pop("rows"), device=name, **found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
