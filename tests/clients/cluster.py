"""An entry with two nodes, for clients that are separate programs."""

import asyncio
import contextlib
import os
import signal
import threading
from concurrent.futures import ThreadPoolExecutor

from tests.cluster.local import LocalCluster


class RunningCluster:
    """A `LocalCluster` in its own thread; a context manager."""

    def __enter__(self):
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._cluster = LocalCluster(nodes=2)
        self._call(self._cluster.__aenter__())
        self.url = self._cluster.entry.http_url
        self.grpc_address = self._cluster.entry.grpc_address
        return self

    def __exit__(self, *_):
        self._call(self._cluster.__aexit__())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def _call(self, work):
        return asyncio.run_coroutine_threadsafe(work, self._loop).result()

    def nodes(self):
        """Names of the nodes that run now, by their addresses."""
        return self._urls(self._call(self._cluster.directory.status()))

    @staticmethod
    def _urls(status):
        return {f"http://127.0.0.1:{node.node.http_port}": node.node.name for node in status.nodes}

    def kill(self, url):
        """Kill the node at this address at once; it is restarted at another address."""
        os.kill(self._cluster.keeper(self.nodes()[url]).pid, signal.SIGKILL)

    def until_replaced(self, url):
        """Wait until another node replaces the killed one at this address."""
        self._call(self._until_replaced(url))

    async def _until_replaced(self, url):
        ready = self._cluster.ready
        await self._cluster.until(lambda s: url not in self._urls(s) and ready(s) == 2)

    @contextlib.contextmanager
    def drained_meanwhile(self):
        """Drain the node of the first agent that comes; its session moves to the other one."""
        with ThreadPoolExecutor() as pool:
            done = pool.submit(self._call, self._drain())
            yield
            done.result(timeout=30)

    async def _drain(self):
        """A new node takes its place."""
        name = await self._walked_on()
        await self._cluster.directory.drain(name)
        await self._cluster.until(lambda s: name not in [node.node.name for node in s.nodes])
        await self._cluster.add_node()

    async def _walked_on(self):
        """The name of the node with agents, once they walk, and clients that test a lost connection
        have done so.
        """
        cluster = self._cluster
        status = await cluster.until(lambda s: cluster.ready(s) == 2 and any(map(busy, s.nodes)))
        await asyncio.sleep(2.5)
        return next(node.node.name for node in status.nodes if busy(node))


def busy(node):
    return node.load.agents > 0
