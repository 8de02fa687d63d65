"""One load run: open the clients, measure, close them."""

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import Any

from wayfarer_lab.load.client import SimulatedClient
from wayfarer_lab.load.memory import MemoryWatch
from wayfarer_lab.load.nuisance import Nuisance
from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.tally import Tally
from wayfarer_lab.load.target import Target


async def run(
    target: Target, plan: LoadPlan, progress: Callable[[float, Tally], None] = lambda _s, _t: None
) -> tuple[dict[str, Any], Tally]:
    """The summary of a run, and its counts. `progress` gets the seconds done, twice a second."""
    tally = Tally()
    clients = [SimulatedClient(target, plan, tally, i) for i in range(plan.sessions)]
    try:
        await asyncio.gather(*(client.open() for client in clients))
        start = time.time() + plan.warm_up
        until = start + plan.seconds
        async with asyncio.TaskGroup() as tasks:
            nuisances = [
                tasks.create_task(work) for work in _nuisances(target, plan, tally, clients)
            ]
            memory = MemoryWatch(target, start, until)
            watches = [
                tasks.create_task(_watch(tally, start, progress)),
                tasks.create_task(memory.run()),
            ]
            healthy = [tasks.create_task(client.run(start, until)) for client in clients]
            used = await _usage(target, start, until)
            await asyncio.wait(healthy)
            memory.sample()
            for task in (*nuisances, *watches):
                task.cancel()
    finally:
        await asyncio.gather(*(client.close() for client in clients), return_exceptions=True)
    return tally.summary(plan.seconds) | used | {"server_rss_mb": memory.summary()}, tally


def _nuisances(
    target: Target, plan: LoadPlan, tally: Tally, clients: list[SimulatedClient]
) -> list[Coroutine[Any, Any, None]]:
    """The slow and the vanishing readers, spread over the sessions."""
    readers = [
        Nuisance(target, plan, tally, clients[number % len(clients)].session_id, number)
        for number in range(plan.slow + plan.vanishing)
    ]
    return [reader.read_slowly() for reader in readers[: plan.slow]] + [
        reader.vanish() for reader in readers[plan.slow :]
    ]


async def _usage(target: Target, start: float, until: float) -> dict[str, Any]:
    """Cores that server and generator use during the measurement."""
    await asyncio.sleep(max(start - time.time(), 0.0))
    began, server, own = time.monotonic(), target.cpu_seconds(), time.process_time()
    await asyncio.sleep(max(until - time.time(), 0.0))
    seconds = time.monotonic() - began
    now = target.cpu_seconds()
    share = None if now is None or server is None else round((now - server) / seconds, 3)
    return {
        "cpu": {"server": share, "generator": round((time.process_time() - own) / seconds, 3)},
    }


async def _watch(tally: Tally, start: float, progress: Callable[[float, Tally], None]) -> None:
    while True:
        progress(max(time.time() - start, 0.0), tally)
        await asyncio.sleep(0.5)
