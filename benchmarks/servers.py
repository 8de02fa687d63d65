"""A server to measure: `wayfarer serve` in its own process, with its CPU time and memory."""

import asyncio
from collections.abc import Mapping
from typing import Any

from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.run import run
from wayfarer_lab.load.target import SERVE, own_server, room

Summary = dict[str, Any]

SESSIONS = 8


def settings(plan: LoadPlan, **more: object) -> dict[str, str]:
    """Settings of a server without limits: it is measured by what it can do."""
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

    return asyncio.run(whole())
