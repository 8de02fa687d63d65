"""Seconds until a server is ready, and its memory then.

    python -m benchmarks.startup [--runs 5] [--engine onnxruntime] [--candidates 4] [--state]
        [--json FILE] [--quick]

From the start of the process to the line that says where it listens: models are checked, opened and
warmed by then. The floor is a process that only imports the libraries. With `--state` the servers
have one state folder, where OpenVINO's compiled networks are kept: the first start, which compiles
them, is shown separately.
"""

import argparse
import asyncio
import subprocess
import sys
import tempfile
import time
from statistics import median

from benchmarks import bench
from benchmarks.models import add_engine
from wayfarer_lab.load.target import own_server

LIBRARIES = "import fastapi, grpc, numpy, onnxruntime, pydantic_settings, structlog, typer, uvicorn"


async def start(*options: str) -> tuple[float, float]:
    """Seconds until a server is ready, and its megabytes then."""
    began = time.perf_counter()
    async with own_server(options, {}) as target:
        return time.perf_counter() - began, target.resident_megabytes() or 0.0


def imports() -> float:
    """Seconds of a process that only imports."""
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", LIBRARIES], check=True)
    return time.perf_counter() - began


def main() -> None:
    """Measures and prints."""
    parser = bench.parser(__doc__)
    parser.add_argument("--runs", type=int, default=5)
    add_engine(parser)
    parser.add_argument("--candidates", type=int, default=1)
    parser.add_argument("--state", action="store_true", help="with a state folder")
    asked: argparse.Namespace = parser.parse_args()
    runs = 2 if asked.quick else asked.runs
    floor = [imports() for _ in range(runs)]
    options = ["--engine", asked.engine, "--candidates", str(asked.candidates)]
    first = []
    with tempfile.TemporaryDirectory() as folder:
        if asked.state:
            options += ["--state-dir", folder]
            first = [asyncio.run(start(*options))]
        found = [asyncio.run(start(*options)) for _ in range(runs)]
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
    for taken, megabytes in first:
        rows.append({"what": "ready at the first start, s", "best": taken, "median": taken})
        rows.append({"what": "RSS then, MB", "best": megabytes, "median": megabytes})
    ratios = {"ready / imports alone": bench.ratio(min(seconds) / min(floor), "lower")}
    bench.finish(
        asked, rows, runs=runs, engine=asked.engine, candidates=asked.candidates, ratios=ratios
    )


if __name__ == "__main__":
    main()
