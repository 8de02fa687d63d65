"""Requests for three times as many agents as fit, to a separate server with the real engine.

    python -m benchmarks.admission --seconds 60

First `clients` ask at once, together for `times` as many agents as the server says fit. Then,
while the admitted agents are streamed, get goals and are watched, clients keep asking for more.
Ends with 1 when an admitted agent missed a primitive, when a refusal took 50 ms or longer, or when
nothing was refused.
"""

import argparse
import asyncio
import json
import math
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import grpc
from tests.fuzz.server import served
from tests.fuzz.streams import stats_of

from wayfarer.v1 import agent_pb2, session_pb2
from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.run import run
from wayfarer_lab.load.tally import Latencies
from wayfarer_lab.load.target import Target
from wayfarer_lab.load.wire import Connection

REFUSAL_MS = 50.0
WARM_UP = 3.0
KNOCKS_PER_SECOND = 10
KNOCKERS = 4
GROUP = 8
"""Agents per request."""

MOST = 1024
LIMITS = {
    name: str(MOST)
    for name in ("AGENTS", "SESSIONS", "SESSIONS_PER_CALLER", "STREAMS", "AGENTS_PER_SESSION")
} | {"CALLS_PER_SECOND": "100000"}
"""Settings with which only time is short."""


@dataclass
class Knocks:
    """Requests for agents while others walk."""

    refused: int = 0
    admitted: int = 0  # agents admitted into room that was left or became free
    refusal: Latencies = field(default_factory=Latencies)


async def knock(target: Target, knocks: Knocks) -> None:
    """Repeatedly asks for agents, and deletes admitted ones at once."""
    connection = Connection(target)
    made = await connection.sessions.CreateSession(session_pb2.CreateSessionRequest())
    specs = [agent_pb2.AgentSpec(gender=1 + number % 2) for number in range(GROUP)]
    request = agent_pb2.CreateAgentsRequest(session_id=made.session.session_id, agents=specs)
    while True:
        began = time.monotonic()
        try:
            let_in = await connection.agents.CreateAgents(request)
        except grpc.aio.AioRpcError as error:
            if error.code() is not grpc.StatusCode.RESOURCE_EXHAUSTED:
                raise
            knocks.refused += GROUP
            knocks.refusal.add(time.monotonic() - began)
        else:
            knocks.admitted += GROUP
            for agent in let_in.agents:
                await connection.agents.DeleteAgent(
                    agent_pb2.DeleteAgentRequest(agent_id=agent.agent_id)
                )
        await asyncio.sleep(KNOCKERS / KNOCKS_PER_SECOND)


async def overload(target: Target, times: float, clients: int, seconds: float) -> dict[str, Any]:
    """Figures of one run."""
    capacity = (await stats_of(target))["capacity"]
    each = math.ceil(times * capacity / clients)
    plan = LoadPlan(clients, each, seconds, WARM_UP, goal_rate=0.2)
    knocks = Knocks()

    async def later() -> None:
        await asyncio.sleep(WARM_UP)  # by then the first requests have been answered
        async with asyncio.TaskGroup() as knockers:
            for _ in range(KNOCKERS):
                knockers.create_task(knock(target, knocks))

    knocking = asyncio.create_task(later())
    try:
        summary, tally = await run(target, plan)
        assert not knocking.done(), knocking
    finally:
        knocking.cancel()
        await asyncio.wait({knocking})
    stats = await stats_of(target)
    return {
        "clients": clients,
        "capacity": capacity,
        "offered": plan.sessions * plan.agents,
        "admitted": tally.agents,
        "refused": tally.refused,
        "refusal_ms": tally.refusal.milliseconds(),
        "knocks": {
            "refused": knocks.refused,
            "admitted": knocks.admitted,
            "refusal_ms": knocks.refusal.milliseconds(),
        },
        "late_chunks": stats["late_chunks"],
    } | {name: summary[name] for name in ("seconds", "chunks", "misses", "lateness_ms", "cpu")}


def faults(found: dict[str, Any]) -> list[str]:
    """Faults of the run."""
    wrong = []
    if found["misses"]:
        wrong.append(f"{found['misses']} of {found['chunks']} primitives were missed")
    for who, refusals in (("at once", found), ("later", found["knocks"])):
        if not refusals["refused"]:
            wrong.append(f"nobody was refused of those who asked {who}")
        elif refusals["refusal_ms"]["max"] >= REFUSAL_MS:
            wrong.append(f"a refusal took {refusals['refusal_ms']['max']:.0f} ms ({who})")
    return wrong


async def main() -> int:
    """Runs it; returns 0 if all is well."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--times", type=float, default=3.0, help="as many agents as fit")
    parser.add_argument("--clients", type=int, default=8, help="who ask at the same instant")
    parser.add_argument("--seconds", type=float, default=30.0, help="that are measured")
    parser.add_argument("--serve", action="append", default=[], help="option for the server")
    parser.add_argument("--json", type=Path, help="write the figures there, too")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        settings = {f"WAYFARER_LIMITS__{name}": value for name, value in LIMITS.items()}
        async with served(Path(folder) / "log", tuple(asked.serve), settings) as server:
            found = await overload(server.target, asked.times, asked.clients, asked.seconds)
            wrong = faults(found) + [f"logged: {error}" for error in server.errors[:10]]
    print(json.dumps(found, indent=2))
    for fault in wrong:
        print(f"FAULT {fault}")
    if asked.json:
        asked.json.write_text(json.dumps(found | {"faults": wrong}, indent=2) + "\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
