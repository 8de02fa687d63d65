"""Seconds until a server is ready, and its memory then.

    python -m benchmarks.startup [--runs 5] [--engine onnxruntime] [--json FILE] [--quick]

From the start of the process to the line that says where it listens: models are checked, opened and
warmed by then. The floor is a process that only imports the libraries.
"""

import argparse
import asyncio
import subprocess
import sys
import time
from statistics import median

from benchmarks import bench
from benchmarks.models import add_engine
from wayfarer_lab.load.target import own_server

LIBRARIES = "import fastapi, grpc, numpy, onnxruntime, pydantic_settings, structlog, typer, uvicorn"


async def start(engine: str) -> tuple[float, float]:
    """Seconds until a server is ready, and its megabytes then."""
    began = time.perf_counter()
    async with own_server(("--engine", engine), {}) as target:
        return time.perf_counter() - began, target.resident_megabytes() or 0.0


def imports() -> float:
    """Seconds of a process that only imports."""
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", LIBRARIES], check=True)
    return time.perf_counter() - began


def main() -> None:
    """Measure, and print."""
    parser = bench.parser(__doc__)
    parser.add_argument("--runs", type=int, default=5)
    add_engine(parser)
    asked: argparse.Namespace = parser.parse_args()
    runs = 2 if asked.quick else asked.runs
    floor = [imports() for _ in range(runs)]
    found = [asyncio.run(start(asked.engine)) for _ in range(runs)]
    seconds = [taken for taken, _ in found]
    rows = [
        {"what": "ready, s", "best": min(seconds), "median": median(seconds)},
        {"what": "imports alone, s", "best": min(floor), "median": median(floor)},
        {
            "what": "RSS when ready, MB",
            "best": min(megabytes for _, megabytes in found),
            "median": median(megabytes for _, megabytes in found),
        },
    ]
    ratios = {"ready / imports alone": bench.ratio(min(seconds) / min(floor), "lower")}
    bench.finish(asked, rows, runs=runs, engine=asked.engine, ratios=ratios)


if __name__ == "__main__":
    main()
