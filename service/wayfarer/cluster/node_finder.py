"""Finds the node for a call, as far as an entry knows, and exports the cluster's metrics."""

import asyncio
import contextlib
import random
import time
from collections.abc import Iterator
from typing import Final

import structlog
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from wayfarer.cluster.group_map import GroupMap
from wayfarer.cluster.messages import SILENT_S, DirectoryLink, NodeInfo, Status
from wayfarer.cluster.routes import Subject
from wayfarer.endpoint import bracketed
from wayfarer.errors import Unavailable, WayfarerError
from wayfarer.ids import request_group

log = structlog.get_logger(__name__)

LOOK_S: Final = 0.25
"""Seconds between looks at the directory."""

HOLD_S: Final = 5.0
"""Seconds that a call waits until the node that has its session or scene answers."""

AGAIN_S: Final = 0.1
"""Seconds between looks while calls wait."""

AWAY_S: Final = 3.0
"""Seconds without an answer after which the directory counts as away."""


class NodeFinder:
    """Which node takes a call, as far as is known here."""

    def __init__(self, directory: DirectoryLink) -> None:
        self._directory = directory
        self._view = GroupMap()
        self._silent: set[str] = set()  # names of nodes
        self._looking = asyncio.Lock()
        self._looked_at = float("-inf")
        self.closing = False
        self._why = ""
        self._heard_at = float("-inf")
        self.status: Status | None = None
        self.head: bool | None = None
        """Whether Ray's head answers. None: there is no Ray, or nobody has looked yet."""

    async def watch(self) -> None:
        """Follows the directory, without end."""
        was_away = None
        while True:
            await self._look()
            if self.away != was_away:
                was_away = self.away
                log.info(f"directory is away: {self._why}" if was_away else "directory answers")
            await asyncio.sleep(LOOK_S)

    async def _look(self) -> None:
        """Looks at the directory as it is now. Calls that wait together share one look."""
        asked_at = time.monotonic()
        async with self._looking:
            if self._looked_at > asked_at:
                return
            self._looked_at = time.monotonic()
            try:
                status, changes = await self._directory.call("look", self._view.seen)
                self._view.take(changes)
                self.status = status
                self._silent = {n.node.name for n in status.nodes if n.silent_s > SILENT_S}
                self._heard_at = time.monotonic()
            except WayfarerError as error:
                self._why = str(error)

    @property
    def away(self) -> bool:
        """Whether the directory does not answer: nothing new is made, what lives is still found."""
        return time.monotonic() - self._heard_at > AWAY_S

    @property
    def ready(self) -> bool:
        """Whether new sessions are welcome."""
        status = self.status
        if self.closing or self.away or status is None:
            return False
        return status.settled and status.capacity > 0

    @property
    def nodes(self) -> list[NodeInfo]:
        """The running nodes."""
        return list(self._view.nodes.values())

    async def all_nodes(self) -> list[NodeInfo]:
        """The running nodes, asked for now; while the directory is away, the last known ones."""
        await self._look()
        return self.nodes

    async def node(self, subject: Subject, caller: str) -> NodeInfo:
        """The node that takes a call about this subject. Raises Unavailable."""
        kind, text = subject
        if kind == "new":
            if self.closing:
                raise Unavailable("the server is shutting down")
            if self.away:
                raise Unavailable("the cluster's directory is away: nothing new is made until then")
            group = request_group(caller, text) if text else ""
            placed: NodeInfo = await self._directory.call("place", group)
            return placed
        if kind == "named":
            await self._until_it_answers(text)
        if kind == "named" and self._owner(text) is None:
            if self.away:  # it may live all the same
                raise Unavailable("the cluster's directory is away: what is new is not found yet")
            await self._look()  # it may have been made a moment ago
        if not self.nodes:
            raise Unavailable("no node of the cluster runs; they are starting or stopping")
        heard = [node for node in self.nodes if node.name not in self._silent] or self.nodes
        found = self._view.node_for(text) if kind == "named" else random.choice(heard)
        assert found is not None
        return found

    def _owner(self, name: str) -> NodeInfo | None:
        """The owner in the view. Raises Unavailable also while that node is silent."""
        owner = self._view.owner(name)
        if owner is not None and owner.name in self._silent:
            raise Unavailable(f"node {owner.name}, which has {name!r}, is silent; try again")
        return owner

    async def _until_it_answers(self, name: str) -> None:
        """Waits while a node adopts the group of this id, or its node is silent: a caller that had
        to call again would do so later than needed.
        """
        ends_at = time.monotonic() + HOLD_S
        while not self.away and time.monotonic() < ends_at:
            with contextlib.suppress(Unavailable):
                self._owner(name)
                return
            await asyncio.sleep(AGAIN_S)
            await self._look()

    def targets(self, host: str) -> list[dict[str, object]]:
        """Returns where the nodes' metrics are, in the format of Prometheus's HTTP service
        discovery. `host`: the one at which the entry was called.
        """
        return [
            {
                "targets": [f"{bracketed(node.host or host)}:{node.http_port}"],
                "labels": {"node": node.name},
            }
            for node in self.nodes
        ]


CHANGES: Final = ("placed", "moved", "adopted", "lost", "expired")
"""Kinds of changes that the directory counts."""


class ClusterFigures(Collector):
    """Metrics of the cluster, by the last answer of the directory."""

    def __init__(self, finder: NodeFinder) -> None:
        self._finder = finder

    def collect(self) -> Iterator[Metric]:
        """Yields the metrics, by the last answer of the directory."""
        where = self._finder
        yield _gauge("directory_up", "The directory answers", float(not where.away))
        if where.head is not None:
            yield _gauge("head_up", "Ray's head answers", float(where.head))
        status = where.status
        if status is None:
            return
        yield _gauge("nodes", "Nodes with a lease", len(status.nodes))
        yield _gauge("capacity", "Agents that the nodes can move in time", status.capacity)
        yield _gauge("agents", "Agents on the nodes that take sessions", status.agents)
        sessions = sum(one.load.sessions for one in status.nodes)
        yield _gauge("sessions", "Sessions on all nodes", sessions)
        changes = GaugeMetricFamily(
            "wayfarer_cluster_changes",
            "Placed sessions, moved, adopted and lost groups, expired leases, since the directory "
            "was started",
            labels=["kind"],
        )
        for kind in CHANGES:  # from 0 on: what appears with its first change is not seen to grow
            changes.add_metric([kind], status.counters.get(kind, 0))
        yield changes


def _gauge(name: str, text: str, value: float) -> Metric:
    return GaugeMetricFamily(f"wayfarer_cluster_{name}", text, value)
