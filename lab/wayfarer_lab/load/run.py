"""One load run: open the clients, measure, close them.

Beside the healthy streams there may be readers that misbehave, and the server's memory is watched.
"""

import asyncio
import random
import time
from collections.abc import Callable, Coroutine
from typing import Any

from wayfarer_lab.load.client import SimulatedClient
from wayfarer_lab.load.plan import LoadPlan
from wayfarer_lab.load.tally import Tally
from wayfarer_lab.load.target import Target
from wayfarer_lab.load.wire import Connection, StreamError, followed


async def run(
    target: Target, plan: LoadPlan, progress: Callable[[float, Tally], None] = lambda _s, _t: None
) -> tuple[dict[str, Any], Tally]:
    """The summary of a run, and its counts. `progress` gets the seconds done, twice a second."""
    tally = Tally(plan.rings)
    clients = [SimulatedClient(target, plan, tally, i) for i in range(plan.sessions)]
    try:
        await asyncio.gather(*(client.open() for client in clients))
        start = time.time() + plan.warm_up
        until = start + plan.seconds
        async with asyncio.TaskGroup() as tasks:
            nuisances = [tasks.create_task(work) for work in _nuisances(plan, tally, clients)]
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
    plan: LoadPlan, tally: Tally, clients: list[SimulatedClient]
) -> list[Coroutine[Any, Any, None]]:
    """The slow and the vanishing readers, spread over the sessions."""
    readers = [
        Nuisance(clients[number % len(clients)], plan, tally, number)
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


SAMPLES = 240
"""Maximum number of samples of a run. There are two a second at most, since each looks through all
processes.
"""


class MemoryWatch:
    """Samples the resident memory of a server that is ours, in megabytes."""

    def __init__(self, target: Target, start: float, until: float) -> None:
        """Unix seconds: measuring begins at `start`, after the warm-up, and ends at `until`."""
        self._target = target
        self._start = start
        self._interval = max((until - time.time()) / SAMPLES, 0.5)
        self.samples: list[tuple[float, float]] = []  # seconds of measuring, megabytes

    async def run(self) -> None:
        """Samples until cancelled."""
        while self.sample():
            await asyncio.sleep(self._interval)

    def sample(self) -> bool:
        """Takes a sample; False for a server that we did not start."""
        megabytes = self._target.resident_megabytes()
        if megabytes is not None:
            self.samples.append((round(time.time() - self._start, 3), round(megabytes, 2)))
        return megabytes is not None

    def summary(self) -> dict[str, Any] | None:
        """At the start of the run, after its warm-up, at the end; and all samples.

        `growth`: of the end beyond the warm-up, as a share. None when nothing was seen.
        """
        if not self.samples:
            return None
        first, last = self.samples[0][1], self.samples[-1][1]
        warm = next((megabytes for seconds, megabytes in self.samples if seconds >= 0), last)
        return {
            "start": first,
            "warm": warm,
            "end": last,
            "growth": round(last / warm - 1, 4),
            "samples": self.samples,
        }


SLOW_SECONDS = 5.0
VANISH_SECONDS = 1.0


class Nuisance:
    """One more reader of a client's session."""

    def __init__(self, client: SimulatedClient, plan: LoadPlan, tally: Tally, number: int) -> None:
        self._target, self._plan, self._tally = client.target, plan, tally
        self._session_id = client.session_id
        self._chance = random.Random(plan.seed * 100_003 - number)
        # seen as by the healthy ones: a stream without rings would make everybody near
        self._viewpoint = plan.viewpoint(plan.sessions + number, tally.failed)

    async def read_slowly(self) -> None:
        """Takes a message every few seconds; reconnects when the server ends the stream."""
        while True:
            connection = Connection(self._target)
            try:
                messages = connection.stream(
                    self._session_id, self._plan.transport, self._viewpoint
                )
                async for _ in messages:
                    await asyncio.sleep(SLOW_SECONDS)
            except StreamError:
                self._tally.failed("SLOW_READER_ENDED")
            finally:
                await connection.close()
            await asyncio.sleep(SLOW_SECONDS)

    async def vanish(self) -> None:
        """Opens streams and cuts them off, one after the other."""
        while True:
            connection = Connection(self._target)
            reading = asyncio.create_task(self._glance(connection))
            try:
                await asyncio.sleep(VANISH_SECONDS * self._chance.uniform(0.2, 1.8))
            finally:
                reading.cancel()
                await asyncio.gather(reading, return_exceptions=True)
                await connection.close()

    async def _glance(self, connection: Connection) -> None:
        messages = followed(
            connection,
            self._session_id,
            self._plan.transport,
            self._tally.first_chunk,
            self._viewpoint,
        )
        async for _ in messages:
            pass
