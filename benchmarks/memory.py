"""Memory of a server, without agents and with more and more of them.

    python -m benchmarks.memory [--agents 0 64 256 1024] [--candidates 1]
                                [--engine onnxruntime] [--json FILE] [--quick]

A fresh server for each row, all with the same limits; its agents walk, and are streamed over gRPC
to eight clients, for some seconds before its resident set (RSS) is read. *kb_per_agent* counts from
the server with none.
"""

import argparse
import asyncio

from benchmarks import bench
from benchmarks.bench import Row
from benchmarks.models import add_engine
from benchmarks.servers import SESSIONS, loaded, settings
from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.target import own_server

AGENTS = (0, 64, 256, 1024)


def resting_megabytes(environment: dict[str, str]) -> float:
    """Resident set of an idle server."""

    async def look() -> float:
        async with own_server((), environment) as target:
            await asyncio.sleep(2.0)
            return target.resident_megabytes() or 0.0

    return asyncio.run(look())


def main() -> None:
    """Measures and prints."""
    parser = bench.parser(__doc__)
    parser.add_argument("--agents", type=int, nargs="+", default=AGENTS)
    parser.add_argument("--candidates", type=int, default=1)
    add_engine(parser)
    asked: argparse.Namespace = parser.parse_args()
    most = LoadPlan(SESSIONS, max(max(asked.agents) // SESSIONS, 1), seconds=1.0)
    environment = settings(most, candidates=asked.candidates, engine=asked.engine)
    rows: list[Row] = []
    nothing = resting_megabytes(environment)
    for agents in asked.agents:
        megabytes = nothing
        if agents:
            seconds = 5.0 if asked.quick else 20.0
            plan = LoadPlan(SESSIONS, max(agents // SESSIONS, 1), seconds, warm_up=3.0)
            megabytes = loaded(plan, environment)["server_rss_mb"]["end"]
        each = 1e3 * (megabytes - nothing) / agents if agents else None
        rows.append({"agents": agents, "rss_mb": megabytes, "kb_per_agent": each})
    found = {
        "RSS with the most agents / with none": bench.ratio(rows[-1]["rss_mb"] / nothing, "lower")
    }
    bench.finish(asked, rows, candidates=asked.candidates, engine=asked.engine, ratios=found)


if __name__ == "__main__":
    main()
