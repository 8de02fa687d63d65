"""Time of a step by engine, batch, candidates and threads, compared with the machine's ceiling.

    python -m benchmarks.step [--engines onnxruntime] [--batches 32 128] [--candidates 1 8]
                              [--threads 1 2] [--model FOLDER] [--json FILE] [--quick]

A step's matrix products are counted from its ONNX graph; the ceiling (GFLOP/s, python -m
benchmarks.gemm) is measured in the same run. The columns of a row:

  ms            of one call of `Engine.step`: the shortest of many
  us_per_agent  that, for each agent of the batch
  mflop         of matrix products, for each agent
  of_gemm       ms, as a multiple of what its products would take at the fp32 ceiling: 1 is perfect;
                below 1: a lower precision
  of_bf16       the same by the bf16 ceiling
  real_time     agents that could be stepped every 0.2 s if the machine did nothing else

The last table shows where the time goes, by kind of operator, as onnxruntime's own profile has it.
With one thread, time is CPU time, which other work on the machine does not lengthen; with more, it
is real time.
"""

import argparse
import json
import tempfile
from collections import Counter
from itertools import product
from pathlib import Path

import onnxruntime

from benchmarks import bench, gemm
from benchmarks.bench import Row
from benchmarks.flops import products
from benchmarks.models import ENGINES, GENDER, opened, step_graph
from wayfarer.commands.serve import share_heaps
from wayfarer.engines.dummy import dummy_inputs
from wayfarer.engines.engine import Engine
from wayfarer.engines.onnx_engine import INPUTS
from wayfarer.models.artifacts import open_session
from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer.spec import STEP_SECONDS

BATCHES = (8, 32, 64, 128, 256, 512, 1024)
CANDIDATES = (1, 4, 8)
THREADS = (1, 2)
QUICK_BATCHES = (8, 128, 1024)
COMPARED_BATCH = 128
"""Batch of the ratios; the target is a ratio of at most 2."""

GROUPS = {
    **dict.fromkeys(("MatMul", "Gemm", "FusedMatMul", "FusedGemm"), "matrix products"),
    **dict.fromkeys(
        ("Transpose", "Concat", "Split", "Slice", "Expand", "Pad", "Reshape"), "copies"
    ),
    **dict.fromkeys(("Unsqueeze", "Squeeze", "Cast"), "copies"),
    **dict.fromkeys(("Gather", "GatherND", "GatherElements"), "gathers"),
    **dict.fromkeys(("Sigmoid", "Tanh", "Relu", "LeakyRelu", "Exp", "QuickGelu"), "activations"),
    **dict.fromkeys(("Add", "Sub", "Mul", "Div", "Neg", "Abs", "Sqrt", "Pow"), "arithmetic"),
}
"""Operators by purpose; the others form one group."""


def step_seconds(engine: Engine, agents: int, candidates: int, threads: int, spend: float) -> float:
    """Seconds of one call."""
    inputs = dummy_inputs(agents, candidates)
    return bench.best(lambda: engine.step(GENDER, inputs), spend, bench.clock_of(threads))


def row(engine: str, agents: int, candidates: int, threads: int, seconds: float) -> Row:
    """The case and its duration; the ceiling's columns are added once it is known."""
    return {
        "engine": engine,
        "candidates": candidates,
        "threads": threads,
        "batch": agents,
        "ms": seconds * 1e3,
        "us_per_agent": seconds / agents * 1e6,
        "real_time": int(agents * STEP_SECONDS / seconds),
    }


def beside_ceiling(rows: list[Row], ceilings: dict[tuple[str, int], float], graph: Path) -> None:
    """Adds the time of each row's products at the ceilings."""
    costs: dict[tuple[int, int], int] = {}
    for line in rows:
        size = (line["batch"], line["candidates"])
        if size not in costs:
            found = products(graph, agents=size[0], candidates=size[1])
            costs[size] = sum(each.flops for each in found)
        line["mflop"] = costs[size] / size[0] / 1e6
        for column, precision in (("of_gemm", "fp32"), ("of_bf16", "bf16")):
            gemm_ms = costs[size] / ceilings[precision, line["threads"]] / 1e6
            line[column] = line["ms"] / gemm_ms


def profile(graph: Path, agents: int, candidates: int, calls: int = 10) -> list[Row]:
    """Share of each group of operators in onnxruntime's time on one thread, in its best call."""
    run, nodes = _profiled(graph, agents, candidates, calls)
    spent: Counter[str] = Counter()
    for event in nodes:
        spent[GROUPS.get(event["args"]["op_name"], "other")] += event["dur"]
    spent["between operators"] = run["dur"] - sum(spent.values())
    return [
        {
            "candidates": candidates,
            "batch": agents,
            "operators": group,
            "share": duration / run["dur"],
            "us_per_agent": duration / agents,
        }
        for group, duration in spent.most_common()
    ]


def _profiled(graph: Path, agents: int, candidates: int, calls: int) -> tuple[Row, list[Row]]:
    """The shortest of some calls, and its operators: events of onnxruntime's profile."""
    inputs = dummy_inputs(agents, candidates)
    feeds = {name: getattr(inputs, name) for name in INPUTS}
    with tempfile.TemporaryDirectory() as folder:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        options.enable_profiling = True
        options.profile_file_prefix = str(Path(folder) / "step")
        session = open_session(graph, options)
        for _ in range(calls):
            session.run(None, feeds)
        events = json.loads(Path(session.end_profiling()).read_text())
    run = min((e for e in events if e["name"] == "model_run"), key=lambda e: float(e["dur"]))
    within = range(run["ts"], run["ts"] + run["dur"] + 1)
    return run, [e for e in events if e["name"].endswith("_kernel_time") and e["ts"] in within]


def ratios(rows: list[Row], shares: list[Row]) -> dict[str, Row]:
    """Figures to compare between runs."""
    found = {
        f"{r['engine']} K={r['candidates']} threads={r['threads']}: step / GEMM": bench.ratio(
            r["of_gemm"], "lower"
        )
        for r in rows
        if r["batch"] == COMPARED_BATCH
    }
    for share in shares:
        if share["operators"] == "matrix products":
            name = f"onnxruntime K={share['candidates']}: share of matrix products"
            found[name] = bench.ratio(share["share"], "higher")
    return found


def main() -> None:
    """Measures and prints."""
    parser = bench.parser(__doc__)
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=ENGINES)
    parser.add_argument("--batches", type=int, nargs="+")
    parser.add_argument("--candidates", type=int, nargs="+", default=CANDIDATES)
    parser.add_argument("--threads", type=int, nargs="+", default=THREADS)
    parser.add_argument("--model", type=Path, default=DEFAULT_MODEL)
    asked: argparse.Namespace = parser.parse_args()
    share_heaps()  # the engines have the server's memory settings
    batches = asked.batches or (QUICK_BATCHES if asked.quick else BATCHES)
    spend = 0.5 if asked.quick else 2.0
    graph = step_graph(asked.model)

    rows = []
    for name, threads in product(asked.engines, asked.threads):
        engine = opened(name, threads, asked.model)
        for candidates, agents in product(asked.candidates, batches):
            seconds = step_seconds(engine, agents, candidates, threads, spend)
            rows.append(row(name, agents, candidates, threads, seconds))
    ours = products(graph, agents=COMPARED_BATCH, candidates=1)
    machine = gemm.measure(asked.threads, ours, spend)
    beside_ceiling(rows, gemm.ceilings(machine), graph)
    shares = [line for k in asked.candidates for line in profile(graph, COMPARED_BATCH, k)]
    bench.show(machine)
    bench.show(shares)
    bench.finish(asked, rows, gemm=machine, shares=shares, ratios=ratios(rows, shares))


if __name__ == "__main__":
    main()
