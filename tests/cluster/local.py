"""A cluster of real node processes, with directory and entry in this process: all but Ray."""

import asyncio
import contextlib
import json
import sys

from wayfarer.cluster.directory import LeaseRules
from wayfarer.cluster.directory_service import DirectoryClient, LocalLink
from wayfarer.cluster.entry import Entry
from wayfarer.cluster.keeper import NodeKeeper
from wayfarer.cluster.messages import NodePlan
from wayfarer.config import Settings
from wayfarer.errors import Unavailable

LEASE_S = 3.0
SECRET = "s" * 32


class Link(LocalLink):
    """One that is `away` for a while."""

    def __init__(self, rules=LeaseRules(LEASE_S)):
        super().__init__(rules)
        self.away = False

    async def call(self, method, body):
        await asyncio.sleep(0)
        if self.away:
            raise Unavailable("the directory is away")
        return await super().call(method, body)


class LocalCluster:
    """As an asynchronous context manager; its nodes are ready inside."""

    def __init__(self, nodes=3, log="/dev/null", **settings):
        """`log`: file of what the nodes say."""
        self.link = Link()
        self.directory = DirectoryClient(self.link)
        common = Settings(
            http_port=0, grpc_port=0, engine="onnxruntime", threads=1, candidates=2,
            admission=False, drain_s=0.5,
            limits={"agents": 32, "agents_per_session": 32}, log_format="json", **settings,
        )  # fmt: skip
        self.settings, self._log = common, log
        self.keepers = [self._keeper(i) for i in range(nodes)]

    def _keeper(self, number):
        return NodeKeeper(
            NodePlan(
                name=f"node{number}",
                number=number,
                host="127.0.0.1",
                secret=SECRET,
                settings=self.settings,
            ),
            self.link,
            ["sh", "-c", f"exec {sys.executable} -m wayfarer node 2>>{self._log}"],
        )

    async def add_node(self):
        """One more; it will be ready some seconds later."""
        keeper = self._keeper(len(self.keepers))
        self.keepers.append(keeper)
        self._keeping.append(asyncio.create_task(keeper.keep()))

    async def __aenter__(self):
        self.entry = self.new_entry(self.settings)
        await self.entry.start()
        self._keeping = [asyncio.create_task(keeper.keep()) for keeper in self.keepers]
        await self.until(lambda status: self.ready(status) == len(self.keepers))
        return self

    async def __aexit__(self, *_):
        for keeper in self.keepers:
            keeper.stop()
        _, late = await asyncio.wait(self._keeping, timeout=20)
        for task in late:
            task.cancel()
        await asyncio.gather(*self._keeping, return_exceptions=True)
        await self.entry.stop()

    def new_entry(self, settings):
        return Entry(settings, self.directory, SECRET, lambda: None)

    @staticmethod
    def ready(status):
        return sum(one.load.ready and one.lease_left_s > 0 for one in status.nodes)

    async def until(self, good, seconds=120):
        """Wait until the directory's status is so."""
        async with asyncio.timeout(seconds):
            while True:
                status = await self.directory.status()
                if good(status):
                    return status
                await asyncio.sleep(0.05)

    def keeper(self, name):
        return next(keeper for keeper in self.keepers if keeper.name == name)


def lines(text):
    """What nodes logged, as dictionaries."""
    for line in text.splitlines():
        with contextlib.suppress(ValueError):
            if isinstance(found := json.loads(line), dict):
                yield found
