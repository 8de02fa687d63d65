"""A server's recovery from disturbances: missed primitives, and the time until it is on time again.

    python -m benchmarks.disturbance [--agents 768] [--engine openvino] [--candidates 1]
        [--kinds quiet stall burst light] [--repeat 1]
        [--rings full:8.5,part:17,root --area 50] [--json FILE] [--quick]

Each kind has a fresh server with walking agents and eight clients over gRPC:

    quiet   nothing; the baseline
    stall   the server's process is stopped (SIGSTOP) for one second
    burst   two processes that compute without a pause for ten seconds
    light   a process that computes for 50 ms of every 250, all the time

*before*, *within* and *after* are the missed primitives that were due in that time. *inevitable*:
primitives of a stall whose last frame was over before it ended. *back_s*: seconds from the end of
the disturbance until the server is on time again, so that for a second nothing is missed or more
than 50 ms late. *worst_ms* is the maximum lateness later than two seconds after the end. With
`--rings` the clients read levels of detail, and each ring has the same figures. A JSON file has
lateness over time, too; a plot is written to its folder.
"""

import argparse
import asyncio
import signal
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from benchmarks import bench
from benchmarks.bench import Row
from benchmarks.models import ENGINES, add_engine
from benchmarks.servers import SESSIONS, Summary, add_rings, ringed, settings
from wayfarer.spec import STEP_SECONDS
from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.report import plot_over_time
from wayfarer_lab.load.run import run
from wayfarer_lab.load.tally import BIN_S, Tally
from wayfarer_lab.load.target import SERVE, Target, own_server

STALL_S: Final = 1.0
BURST_S: Final = 10.0
BUSY: Final = 2
"""Processes of a burst."""

ON_TIME_MS: Final = 50.0
CALM_S: Final = 1.0
"""Seconds on time after which a server counts as recovered."""

SETTLED_S: Final = 2.0
"""Seconds after a disturbance after which everything should be as before."""

WARM_UP: Final = 15.0

SPIN: Final = "while True: pass"
LIGHT: Final = """
import time
while True:
    until = time.monotonic() + 0.05
    while time.monotonic() < until: pass
    time.sleep(0.2)
"""


async def quiet(_: Target) -> None:
    """Does nothing."""


async def stall(target: Target) -> None:
    """Stops the server for a second."""
    assert target.process is not None
    target.process.send_signal(signal.SIGSTOP)
    await asyncio.sleep(STALL_S)
    target.process.send_signal(signal.SIGCONT)


async def burst(_: Target) -> None:
    """Runs two processes that compute."""
    await _beside(SPIN, BUSY, BURST_S)


async def _beside(code: str, count: int, seconds: float) -> None:
    busy = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(count)]
    try:
        await asyncio.sleep(seconds)
    finally:
        for process in busy:
            process.kill()
            process.wait()


KINDS: Final[dict[str, Callable[[Target], Awaitable[None]]]] = {
    "quiet": quiet,
    "stall": stall,
    "burst": burst,
    "light": quiet,  # during the whole run
}


@dataclass
class Span:
    """Start and end of a disturbance, in seconds of measuring."""

    start: float
    end: float


async def disturbed(
    kind: str, plan: LoadPlan, at: float, environment: dict[str, str], command: tuple[str, ...]
) -> tuple[Summary, Span]:
    """A fresh server under load that is disturbed `at` seconds of measuring."""
    began: list[float] = []  # start of measuring, Unix seconds
    due = asyncio.Event()

    def progress(done: float, _: Tally) -> None:
        if done > 0 and not began:
            began.append(time.time() - done)
        if done >= at:
            due.set()

    async with own_server((), environment, command) as target:

        async def disturb() -> Span:
            await due.wait()
            start = time.time() - began[0]
            await KINDS[kind](target)
            return Span(start, time.time() - began[0])

        beside = [subprocess.Popen([sys.executable, "-c", LIGHT])] if kind == "light" else []
        try:
            (summary, _), span = await asyncio.gather(run(target, plan, progress), disturb())
        finally:
            for process in beside:
                process.kill()
                process.wait()
    return summary, span


def missed(rows: list[dict[str, float]], since: float, until: float) -> int:
    """Missed primitives that were due in this time; an interval counts where its middle is."""
    return int(sum(r["missed"] for r in rows if since <= r["at"] + BIN_S / 2 < until))


def back_after(rows: list[dict[str, float]], end: float) -> float | None:
    """Seconds from `end` until a second on time begins; None: it never did."""
    if not rows:
        return None
    late = [r["at"] for r in rows if r["missed"] or r["max_ms"] > ON_TIME_MS]
    last = rows[-1]["at"] + BIN_S
    for start in [end, *(at + BIN_S for at in late if at + BIN_S > end)]:
        calm = not any(start <= at + BIN_S / 2 < start + CALM_S for at in late)
        if calm and start + CALM_S <= last:
            return start - end
    return None


def row(kind: str, agents: int, summary: Summary, span: Span) -> Row:
    """The figures of a run."""
    over = int((span.end - span.start) / STEP_SECONDS) - 1 if kind == "stall" else 0
    return {
        "kind": kind,
        "agents": summary["agents"],
        "inevitable": over * agents,
        **course(summary, span),
        "server": summary["cpu"]["server"],
    }


def ring_rows(kind: str, summary: Summary, span: Span) -> list[Row]:
    """The figures of each ring of a run."""
    return [
        {"kind": kind, "ring": ring["ring"], "people": ring["people"], **course(ring, span)}
        for ring in summary["rings"]
    ]


def course(figures: dict[str, Any], span: Span) -> Row:
    """The figures of all primitives, or of a ring's."""
    rows, late = figures["over_time"], figures["lateness_ms"]
    settled = [r["max_ms"] for r in rows if r["at"] >= span.end + SETTLED_S]
    return {
        "before": missed(rows, 0.0, span.start),
        "within": missed(rows, span.start, span.end),
        "after": missed(rows, span.end, float("inf")),
        "back_s": back_after(rows, span.end),
        "worst_ms": max(settled, default=None),
        "p99_ms": late and late["p99"],
        "held": figures["held"],
        "reduced": figures["reduced"],
    }


def plot(path: Path, runs: list[dict[str, Any]]) -> None:
    """Plots lateness over time, one run below the other."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3 * len(runs)), layout="constrained")
    for axes, one in zip(figure.subplots(len(runs), squeeze=False).flat, runs, strict=True):
        plot_over_time(axes, one["over_time"])
        axes.axvspan(one["start"], one["end"], color="gray", alpha=0.2)
        axes.set_title(f"{one['kind']}, {one['agents']} agents")
    figure.savefig(path, dpi=120)


def main() -> None:
    """Measures and prints."""
    parser = bench.parser(__doc__)
    parser.add_argument("--agents", type=int, default=768)
    add_engine(parser)
    parser.set_defaults(engine=ENGINES[-1])
    parser.add_argument("--candidates", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    add_rings(parser)
    parser.add_argument("--repeat", type=int, default=1, help="runs of each kind")
    parser.add_argument("--after", type=float, help="seconds after it: 15, or 6 when quick")
    asked: argparse.Namespace = parser.parse_args()
    at, after = (3.0, asked.after or 6.0) if asked.quick else (8.0, asked.after or 15.0)
    each = max(asked.agents // SESSIONS, 1)
    command = (*SERVE, "--engine", asked.engine)
    rows, of_rings, runs = [], [], []
    for kind in [kind for kind in asked.kinds for _ in range(asked.repeat)]:
        lasts = {"stall": STALL_S, "burst": BURST_S}.get(kind, 0.0)
        warm_up = 3.0 if asked.quick else WARM_UP
        plan = LoadPlan(SESSIONS, each, at + lasts + after, warm_up, **ringed(asked))
        environment = settings(plan, candidates=asked.candidates)
        summary, span = asyncio.run(disturbed(kind, plan, at, environment, command))
        rows.append(row(kind, each * SESSIONS, summary, span))
        of_rings += ring_rows(kind, summary, span)
        runs.append({"kind": kind, **vars(span), **summary})
        print({k: v for k, v in rows[-1].items() if v is not None}, flush=True)
    more = {"engine": asked.engine, "candidates": asked.candidates, "runs": runs}
    bench.finish(asked, rows + of_rings, **more)
    if asked.json:
        plot(asked.json.with_suffix(".png"), runs)


if __name__ == "__main__":
    main()
