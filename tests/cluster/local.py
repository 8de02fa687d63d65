"""A cluster of a few nodes on a Ray of this process, with its entry beside it."""

import asyncio
import contextlib
import json
from pathlib import Path

import psutil

from wayfarer.cluster.directory import LeaseRules
from wayfarer.cluster.entry import Entry
from wayfarer.cluster.messages import NodePlan
from wayfarer.config import Settings
from wayfarer.errors import Unavailable
from wayfarer.serve import NODE

LEASE_S = 3.0


class LocalCluster:
    """As an asynchronous context manager; its nodes are ready inside."""

    def __init__(self, nodes=3, **settings):
        self.settings = Settings(
            http_port=0, grpc_port=0, engine="onnxruntime", threads=1, candidates=2,
            admission=False, drain_s=0.5,
            limits={"agents": 32, "agents_per_session": 32}, log_format="json", **settings,
        )  # fmt: skip
        self._count = nodes
        self._started = 0

    def add_node(self):
        """One more; it will be ready some seconds later."""
        name, number = f"node{self._started}", self._started
        plan = NodePlan(name=name, number=number, host="127.0.0.1", settings=self.settings)
        self._ray.keep(plan, NODE)
        self._started += 1

    async def __aenter__(self):
        from wayfarer.cluster.actors import RayNodes
        from wayfarer.cluster.ray_cluster import RayCluster

        self.nodes = RayNodes()
        self._ray = RayCluster()
        self.link = self._ray.directory(LeaseRules(LEASE_S))
        for _ in range(self._count):
            self.add_node()
        self.entry = self.new_entry(self.settings)
        await self.entry.start()
        await self.until(lambda status: self.ready(status) == self._count)
        return self

    async def __aexit__(self, *_):
        await self.entry.stop()
        self._ray.close()

    def new_entry(self, settings):
        return Entry(settings, self.link, self.nodes, lambda: None)

    @staticmethod
    def ready(status):
        return sum(one.load.ready and one.lease_left_s > 0 for one in status.nodes)

    async def status(self):
        return (await self.link.call("look", (0, 0)))[0]

    async def until(self, good, seconds=120):
        """Wait until the directory's status is so."""
        async with asyncio.timeout(seconds):
            while True:
                with contextlib.suppress(Unavailable):
                    status = await self.status()
                    if good(status):
                        return status
                await asyncio.sleep(0.05)

    async def process(self, name):
        """Of a node."""
        nodes = (await self.status()).nodes
        port = next(one.node.grpc_port for one in nodes if one.node.name == name)
        for one in psutil.Process().children(recursive=True):
            if "NodeActor" in " ".join(one.cmdline()) and port in listening(one):
                return one
        raise LookupError(name)

    def said(self):
        """What nodes logged, as dictionaries, in the order of time."""
        files = Path(self._ray.logs).glob("worker*.err")
        found = [line for file in files for line in lines(file.read_text())]
        return sorted(found, key=lambda line: line["timestamp"])


def listening(process):
    return [one.laddr.port for one in process.net_connections() if one.status == "LISTEN"]


def lines(text):
    for line in text.splitlines():
        with contextlib.suppress(ValueError):
            if isinstance(found := json.loads(line), dict):
                yield found
