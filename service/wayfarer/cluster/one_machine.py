"""`wayfarer serve --workers N`: N nodes on this machine. Their directory, their keepers and the
entry are in this process, and they end with it.
"""

import asyncio
import signal
from collections.abc import Callable
from typing import Final

import structlog

from wayfarer.cluster.directory import LeaseRules
from wayfarer.cluster.directory_service import DirectoryClient, LocalLink
from wayfarer.cluster.entry import Entry
from wayfarer.cluster.keeper import NodeKeeper
from wayfarer.cluster.plans import node_plans
from wayfarer.config import Settings
from wayfarer.errors import Unavailable

log = structlog.get_logger(__name__)

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)

LEASE_S: Final = 10.0
"""The end of a node's process is known at once; only a node that hangs is known by its lease."""

LOOK_S: Final = 0.1
GRACE_S: Final = 5.0
"""Beyond what a node takes at most to drain."""


async def serve_nodes(settings: Settings, announce: Callable[[str, str], None]) -> None:
    """Run until SIGINT, SIGTERM or AdminService.Drain.

    `announce` gets the HTTP URL and the gRPC address once all nodes are ready.
    Raises Unavailable when a port is taken, or a node cannot start.
    """
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    for sign in SIGNALS:
        loop.add_signal_handler(sign, stop.set)
    plans = node_plans(settings)
    link = LocalLink(
        LeaseRules(LEASE_S, nodes=settings.workers, keep=settings.state_dir is not None)
    )
    directory = DirectoryClient(link)
    entry = Entry(settings, directory, plans[0].secret, stop.set)
    keepers = [NodeKeeper(plan, link) for plan in plans]

    def reload() -> None:
        entry.reload()
        for keeper in keepers:
            keeper.reload()

    loop.add_signal_handler(signal.SIGHUP, reload)
    await entry.start()
    keeping = [asyncio.create_task(one.keep(), name=one.name) for one in keepers]
    try:
        while not (stop.is_set() or await _all_ready(directory, keepers)):
            await asyncio.sleep(LOOK_S)
        if not stop.is_set():
            announce(entry.http_url, entry.grpc_address)
        # a node that is drained ends by itself
        while not (stop.is_set() or all(task.done() for task in keeping)):
            await asyncio.sleep(LOOK_S)
        for sign in SIGNALS:
            loop.remove_signal_handler(sign)  # one more ends the process at once
        log.info("draining", nodes=len(plans))
        entry.drain()
    finally:
        for keeper in keepers:
            keeper.stop()
        _, late = await asyncio.wait(keeping, timeout=2 * settings.drain_s + GRACE_S)
        for task in late:
            log.error("node killed, since it did not end", node=task.get_name())
            task.cancel()
        await asyncio.wait(keeping)
        await entry.stop()
    log.info("stopped")


async def _all_ready(directory: DirectoryClient, keepers: list[NodeKeeper]) -> bool:
    """Raises Unavailable when a node has ended before all were."""
    for number, keeper in enumerate(keepers):
        if keeper.restarts:
            raise Unavailable(f"node {number} ended while it was starting; see above")
    status = await directory.status()
    return status.settled and sum(one.load.ready for one in status.nodes) == len(keepers)
