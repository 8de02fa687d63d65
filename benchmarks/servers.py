"""A server to measure: `wayfarer serve` in its own process, with its CPU time and memory."""

import argparse
from collections.abc import Mapping
from typing import Any

from benchmarks.bench import Row
from wayfarer.errors import InvalidArgument
from wayfarer.process import event_loop
from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.rings import LoadRing, parse_rings
from wayfarer_lab.load.run import run
from wayfarer_lab.load.target import SERVE, own_server, room

Summary = dict[str, Any]

SESSIONS = 8


def add_rings(parser: argparse.ArgumentParser) -> None:
    """Options for readers with levels of detail; `ringed` gives them to a plan."""
    parser.add_argument(
        "--rings", type=_rings, default=(), help="as of wayfarer load: full:8.5,part:17,root"
    )
    parser.add_argument(
        "--area", type=float, default=LoadPlan.area, help="metres, as of wayfarer load"
    )


def _rings(text: str) -> tuple[LoadRing, ...]:
    try:
        return parse_rings(text)
    except InvalidArgument as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def ringed(asked: argparse.Namespace) -> dict[str, Any]:
    """Arguments of `LoadPlan` from the options of `add_rings`."""
    return {"rings": asked.rings, "area": asked.area}


def ring_rows(summary: Summary, **of_run: object) -> list[Row]:
    """The figures of each ring of a run; `of_run` distinguishes the runs."""
    kept = ("ring", "people", "misses", "reduced", "held")
    return [
        {
            **of_run,
            **{name: ring[name] for name in kept},
            **{f"{name}_ms": (ring["lateness_ms"] or {}).get(name) for name in ("p50", "p99")},
            "kb_s_person": ring["kb_s_person"],
        }
        for ring in summary["rings"]
    ]


def settings(plan: LoadPlan, **more: object) -> dict[str, str]:
    """Settings of a server without limits, whose capacity is measured."""
    found = room(plan.sessions * plan.agents, plan) | {"WAYFARER_ADMISSION": "false"}
    return found | {f"WAYFARER_{name.upper()}": str(value) for name, value in more.items()}


def loaded(
    plan: LoadPlan, environment: Mapping[str, str], command: tuple[str, ...] = SERVE
) -> Summary:
    """A fresh server under one load: the summary of the run. Raises Unavailable."""

    async def whole() -> Summary:
        async with own_server((), environment, command) as target:
            summary, _ = await run(target, plan)
            return summary

    return event_loop.run(whole())
