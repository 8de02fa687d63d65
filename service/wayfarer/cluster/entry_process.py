"""The process of `serve --workers` and of `wayfarer cluster`: an entry, which
also starts the nodes.
"""

import asyncio
import contextlib
import signal
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractAsyncContextManager
from typing import Final

import structlog

from wayfarer.cluster.actors import RayNodes, on_daemon
from wayfarer.cluster.directory import LeaseRules
from wayfarer.cluster.entry import Entry
from wayfarer.cluster.messages import DirectoryLink, NodePlan
from wayfarer.cluster.ray_cluster import RayCluster
from wayfarer.config.settings import Settings

log = structlog.get_logger(__name__)

LEASE_S: Final = 10.0
"""Seconds of a lease on one machine, where only a hang is noticed by the end of the lease."""

LOOK_S: Final = 2.0
"""Seconds between looks at Ray's head."""

READY_S: Final = 0.1
SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


@contextlib.contextmanager
def on_ray(address: str = "") -> Iterator[RayCluster]:
    """Ray, until the end of a command, whose process ignores signals from then on. `address`: see
    `RayCluster`.
    """
    ray = RayCluster(address)
    try:
        yield ray
    finally:
        for sign in SIGNALS:  # a second one would leave nodes behind
            signal.signal(sign, signal.SIG_IGN)
        ray.close()


async def run_workers(
    ray: RayCluster,
    settings: Settings,
    plans: list[NodePlan],
    serve: str,
    announce: Callable[[str, str], None],
) -> None:
    """`wayfarer serve --workers N`: runs the nodes and an entry until SIGINT, SIGTERM or
    AdminService.Drain. `serve`: see `NodeActor`.

    `announce` gets the HTTP URL and the gRPC address once all nodes are ready. Raises Unavailable
    when a port is taken, or a node cannot start.
    """

    @contextlib.asynccontextmanager
    async def nodes() -> AsyncIterator[None]:
        for plan in plans:
            ray.keep(plan, serve)
        await ray.until_ready()
        yield

    rules = LeaseRules(LEASE_S, nodes=len(plans), keep=settings.state_dir is not None)
    await enter(settings, ray.directory(rules), ray, nodes(), announce)


async def enter(
    settings: Settings,
    link: DirectoryLink,
    ray: RayCluster,
    beside: AbstractAsyncContextManager[None],
    announce: Callable[[str, str], None],
) -> None:
    """Runs an entry until a signal comes. `beside` is entered first, and a signal ends it, too."""
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    for sign in SIGNALS:
        loop.add_signal_handler(sign, stop.set)
    entry = Entry(settings, link, RayNodes(), stop.set)

    def reload() -> None:
        entry.reload()
        ray.reload()

    loop.add_signal_handler(signal.SIGHUP, reload)

    async def work() -> None:
        async with beside:
            while not entry.finder.ready:
                await asyncio.sleep(READY_S)
            announce(entry.http_url, entry.grpc_address)
            await asyncio.Event().wait()

    await entry.start()
    stopping = asyncio.create_task(stop.wait(), name="stop")
    watching = asyncio.create_task(_watch_head(ray, entry), name="head")
    working = asyncio.create_task(work(), name="work")
    try:
        await asyncio.wait((stopping, working), return_when=asyncio.FIRST_COMPLETED)
        if working.done():
            working.result()  # raises
        log.info("draining")
        entry.drain()
    finally:
        for task in (stopping, watching, working):
            task.cancel()
        await asyncio.wait((stopping, watching, working))
        await entry.stop()


async def _watch_head(ray: RayCluster, entry: Entry) -> None:
    """Reports to the entry whether Ray's head answers, until cancelled."""
    while True:
        answers = await on_daemon(ray.head_answers)
        if answers == (entry.finder.head is False):  # it was otherwise
            log.warning("Ray's head answers again" if answers else "Ray's head is away")
        entry.finder.head = answers
        await asyncio.sleep(LOOK_S)
