"""One load run: open the clients, measure, close them."""

import asyncio
import time
from collections.abc import Callable
from typing import Any

from wayfarer.load.client import SimulatedClient
from wayfarer.load.plan import Plan
from wayfarer.load.tally import Tally
from wayfarer.load.target import Target


async def run(
    target: Target, plan: Plan, progress: Callable[[float, Tally], None] = lambda _s, _t: None
) -> tuple[dict[str, Any], Tally]:
    """The summary of a run, and its counts. `progress` hears of seconds done, twice a second."""
    tally = Tally()
    clients = [SimulatedClient(target, plan, tally, i) for i in range(plan.sessions)]
    try:
        await asyncio.gather(*(client.open() for client in clients))
        start = time.time() + plan.warm_up
        until = start + plan.seconds
        async with asyncio.TaskGroup() as tasks:
            nuisances = [
                tasks.create_task(clients[i % len(clients)].read_slowly()) for i in range(plan.slow)
            ] + [
                tasks.create_task(clients[i % len(clients)].vanish()) for i in range(plan.vanishing)
            ]
            watch = tasks.create_task(_watch(tally, start, progress))
            healthy = [tasks.create_task(client.run(start, until)) for client in clients]
            used = await _usage(target, start, until)
            await asyncio.wait(healthy)
            for task in (*nuisances, watch):
                task.cancel()
    finally:
        await asyncio.gather(*(client.close() for client in clients), return_exceptions=True)
    return tally.summary(plan.seconds) | used, tally


async def _usage(target: Target, start: float, until: float) -> dict[str, Any]:
    """Cores that server and generator use while it is measured, and the server's memory."""
    await asyncio.sleep(max(start - time.time(), 0.0))
    began, server, own = time.monotonic(), target.cpu_seconds(), time.process_time()
    memory = [target.resident_megabytes()]
    await asyncio.sleep(max(until - time.time(), 0.0))
    seconds = time.monotonic() - began
    now = target.cpu_seconds()
    share = None if now is None or server is None else round((now - server) / seconds, 3)
    memory.append(target.resident_megabytes())
    return {
        "cpu": {"server": share, "generator": round((time.process_time() - own) / seconds, 3)},
        "server_rss_mb": dict(zip(("start", "end"), memory, strict=True)),
    }


async def _watch(tally: Tally, start: float, progress: Callable[[float, Tally], None]) -> None:
    while True:
        progress(max(time.time() - start, 0.0), tally)
        await asyncio.sleep(0.5)
