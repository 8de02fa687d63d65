"""Table S3 of the paper in our form: seconds for N bodies to move by one primitive.

    python -m benchmarks.paper_s3 [--engine onnxruntime] [--threads 0] [--json FILE] [--quick]

The paper (Tab. S3, one Quadro 6000) steps a batch of bodies with one latent each; so does this, on
the CPU, from 64 bodies on, doubling until a primitive takes longer than it lasts. *one call*
steps all bodies at once; *best calls* cuts them into calls of the size with the least cost per
body. A primitive of ours has 10 frames as theirs, two of them shared with the one before: it has to
be there every 0.2 s (the paper counts with 0.25 s).
"""

import argparse
import time
from math import ceil
from pathlib import Path

from benchmarks import bench
from benchmarks.bench import Row
from benchmarks.models import GENDER, add_engine, opened
from wayfarer.engines.dummy import dummy_inputs
from wayfarer.engines.engine import Engine
from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer.process.processor import cores
from wayfarer.spec import STEP_SECONDS

PAPER_SECONDS = {64: 0.1, 128: 0.15, 256: 0.25, 512: 0.5, 1024: 0.85}
CALL_SIZES = (8, 16, 32, 64, 128, 256)
MOST = 1 << 16


def call_seconds(engine: Engine, agents: int, spend: float, candidates: int = 1) -> float:
    """Seconds of one call, in real time, since it may use several threads."""
    inputs = dummy_inputs(agents, candidates)
    return bench.best(lambda: engine.step(GENDER, inputs), spend, time.perf_counter)


def table(engine: Engine, spend: float) -> list[Row]:
    """Rows for 64 bodies and more."""
    sizes = {size: call_seconds(engine, size, spend) for size in CALL_SIZES}
    size = min(sizes, key=lambda size: sizes[size] / size)
    rows: list[Row] = []
    bodies = min(PAPER_SECONDS)
    while bodies <= MOST:
        whole = call_seconds(engine, bodies, spend)
        cut = sizes[size] * ceil(bodies / size)
        seconds = min(whole, cut)
        paper = PAPER_SECONDS.get(bodies)
        rows.append(
            {
                "bodies": bodies,
                "paper_s": paper,
                "one_call_s": whole,
                "best_calls_s": cut,
                "call_size": size,
                "paper / ours": paper and paper / seconds,
                "in_real_time": seconds <= STEP_SECONDS,
            }
        )
        if seconds > STEP_SECONDS and bodies >= max(PAPER_SECONDS):
            break
        bodies *= 2
    return rows


def main() -> None:
    """Measures and prints."""
    parser = bench.parser(__doc__)
    add_engine(parser)
    parser.add_argument("--threads", type=int, default=0, help="0: one for each core")
    parser.add_argument("--model", type=Path, default=DEFAULT_MODEL)
    asked: argparse.Namespace = parser.parse_args()
    threads = asked.threads or cores()
    rows = table(opened(asked.engine, threads, asked.model), 0.3 if asked.quick else 2.0)
    largest = next(row for row in rows if row["bodies"] == max(PAPER_SECONDS))
    whole = bench.ratio(largest["one_call_s"] / largest["best_calls_s"], "lower")
    bench.finish(
        asked,
        rows,
        engine=asked.engine,
        threads=threads,
        ratios={"1,024 bodies in one call / in best calls": whole},
    )


if __name__ == "__main__":
    main()
