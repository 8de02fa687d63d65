"""The whole service: the number of agents in real time, streamed to eight clients.

    python -m benchmarks.service [--candidates 1 8] [--engine onnxruntime] [--seconds 300]
                                 [--transports grpc websocket] [--most 2048] [--agents N]
                                 [--rings full:8.5,part:17,root --area 50]
                                 [--json FILE] [--quick]

In real time: every agent is stepped every 0.2 s, all with the full number of candidates; no
primitive is missed, and p99 of lateness at the client is within 50 ms. Bisection in short runs over
gRPC finds the most agents for which that holds. A fresh server then holds them for `--seconds` over
each transport, or 5 % fewer if that fails, at most three times. `--agents` replaces the search by a
number, which is held once. With `--rings` the clients read levels of detail around viewpoints that
walk, and there are figures for each ring, too. Server and generator share the machine; *server* and
*generator* are the cores that they use, *alone* is the number of agents that the engine could step
in the same time if all cores did nothing else; *_us* are the same as microseconds of processor time
for each agent and step.
"""

import argparse
from dataclasses import replace
from math import ceil
from typing import Any

from benchmarks import bench
from benchmarks.bench import Row
from benchmarks.models import add_engine, opened
from benchmarks.paper_s3 import CALL_SIZES, call_seconds
from benchmarks.servers import SESSIONS, add_rings, loaded, ring_rows, ringed, settings
from wayfarer.commands.serve import share_heaps
from wayfarer.engines.engine import Engine
from wayfarer.process import event_loop
from wayfarer.process.processor import cores
from wayfarer.spec import STEP_SECONDS
from wayfarer_lab.load.knee import find_knee, in_time
from wayfarer_lab.load.plan import TRANSPORTS, LoadPlan
from wayfarer_lab.load.run import run
from wayfarer_lab.load.target import SERVE, own_server

P99_MS = 50.0
FEWER = 0.95
TRIES = 3
WARM_UP = 20.0
"""Seconds before the measurement: all agents come at once, and then all start to walk."""

SHORT_WARM_UP = 10.0
"""Seconds before a short run of the search: a server that was late when all came leaves work out
for `BudgetRules.patience` seconds or twice as long.
"""

Summary = dict[str, Any]


def alone(engine: Engine, candidates: int, spend: float) -> int:
    """Agents that the engine steps every 0.2 s in calls of its best size."""
    each = min(call_seconds(engine, size, spend, candidates) / size for size in CALL_SIZES)
    return int(STEP_SECONDS / each)


async def search(
    plan: LoadPlan, most: int, command: tuple[str, ...], environment: dict[str, str]
) -> int:
    """The maximum number of agents that are served in time in runs like `plan`."""
    async with own_server((), environment, command) as target:

        async def trial(each: int) -> Summary:
            summary, _ = await run(target, replace(plan, agents=each))
            tell(summary, plan)
            return summary

        each, _ = await find_knee(trial, ceil(most / plan.sessions), P99_MS)
    return each * plan.sessions


def held(plan: LoadPlan, candidates: int, command: tuple[str, ...], tries: int = TRIES) -> Summary:
    """A long run with the agents of `plan`, or fewer until all are in time."""
    for _ in range(tries):
        summary = loaded(plan, settings(plan, candidates=candidates), command)
        tell(summary, plan)
        if in_time(summary, P99_MS):
            break
        plan = replace(plan, agents=max(int(plan.agents * FEWER), 1))
    return summary


def tell(summary: Summary, plan: LoadPlan) -> None:
    """A line of progress."""
    late = summary["lateness_ms"]
    print(
        f"  {summary['agents']} agents over {plan.transport}, {plan.seconds:g} s: "
        f"p99 {late['p99'] if late else float('nan'):.1f} ms, {summary['misses']} missed, "
        f"{summary['reduced']} reduced, {summary['held']} held",
        flush=True,
    )


def row(engine: str, candidates: int, plan: LoadPlan, engine_alone: int, summary: Summary) -> Row:
    """The figures of a long run."""
    late, goals = summary["lateness_ms"], summary["goal_latency_ms"]
    cpu, per_step = summary["cpu"], 1e6 * STEP_SECONDS / max(summary["agents"], 1)
    return {
        "engine": engine,
        "candidates": candidates,
        "transport": plan.transport,
        "agents": summary["agents"],
        "in_time": in_time(summary, P99_MS),
        "seconds": summary["seconds"],
        "misses": summary["misses"],
        "reduced": summary["reduced"],
        "held": summary["held"],
        "p50_ms": late and late["p50"],
        "p99_ms": late and late["p99"],
        "p999_ms": late and late["p999"],
        "max_ms": late and late["max"],
        "goal_p95_ms": goals and goals["p95"],
        "server": cpu["server"],
        "generator": cpu["generator"],
        "server_us": cpu["server"] * per_step,
        "generator_us": cpu["generator"] * per_step,
        "rss_mb": summary["server_rss_mb"] and summary["server_rss_mb"]["end"],
        "alone": engine_alone,
        "alone_us": 1e6 * STEP_SECONDS * cores() / max(engine_alone, 1),
    }


def main() -> None:
    """Measures and prints."""
    parser = bench.parser(__doc__)
    add_engine(parser)
    parser.add_argument("--candidates", type=int, nargs="+", default=[1, 8])
    parser.add_argument("--transports", nargs="+", choices=TRANSPORTS, default=TRANSPORTS)
    parser.add_argument("--most", type=int, default=2048, help="where the search begins")
    parser.add_argument(
        "--agents", type=int, help="hold this number of agents instead of searching for the most"
    )
    add_rings(parser)
    parser.add_argument("--seconds", type=float, help="of the long runs: 300, or 15 when quick")
    asked: argparse.Namespace = parser.parse_args()
    seconds = asked.seconds or (15.0 if asked.quick else 300.0)
    share_heaps()  # the engine alone has the server's memory settings
    command = (*SERVE, "--engine", asked.engine)
    count = cores()

    rows, of_rings, ratios = [], [], {}
    for candidates in asked.candidates:
        engine = opened(asked.engine, count)
        could = alone(engine, candidates, 0.3 if asked.quick else 1.0)
        del engine
        short = LoadPlan(SESSIONS, 1, 6.0 if asked.quick else 15.0, SHORT_WARM_UP, **ringed(asked))
        room = settings(replace(short, agents=asked.most), candidates=candidates)
        agents = asked.agents or event_loop.run(search(short, asked.most, command, room))
        for transport in asked.transports:
            each = max(agents // SESSIONS, 1)
            plan = LoadPlan(SESSIONS, each, seconds, WARM_UP, transport, **ringed(asked))
            summary = held(plan, candidates, command, 1 if asked.agents else TRIES)
            rows.append(row(asked.engine, candidates, plan, could, summary))
            of_rings += ring_rows(summary, candidates=candidates, transport=transport)
            name = f"{asked.engine} K={candidates} over {transport}: agents in time / engine alone"
            served = summary["agents"] if rows[-1]["in_time"] else 0
            ratios[name] = bench.ratio(served / max(could, 1), "higher")
    bench.finish(asked, rows + of_rings, ratios=ratios)


if __name__ == "__main__":
    main()
