"""An entry with two nodes, for clients that are separate programs."""

import asyncio
import contextlib
import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import httpx
import psutil
import pytest

from tests.cluster.local import LocalCluster, listening


class RunningCluster:
    """A `LocalCluster` in a separate process, since a process has one Ray; a context manager."""

    def __enter__(self):
        pytest.importorskip("ray")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.clients.cluster"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.url, self.grpc_address = self._until_ready()
        return self

    def _until_ready(self):
        for line in self._process.stdout:
            if line.startswith('["http'):
                return json.loads(line)
        pytest.fail("the cluster did not start")

    def __exit__(self, *_):
        self._process.communicate(timeout=60)

    def _states(self):
        return httpx.get(f"{self.url}/v1/cluster").raise_for_status().json()["nodes"]

    def nodes(self):
        """Names of the nodes that run now, by their addresses."""
        return {f"http://127.0.0.1:{one['node']['http_port']}": one["node"]["name"]
                for one in self._states()}  # fmt: skip

    def kill(self, url):
        """Kill the node at this address at once; it is restarted at another address."""
        port = int(url.rpartition(":")[2])
        for one in psutil.Process(self._process.pid).children(recursive=True):
            if port in listening(one):
                one.kill()

    def until_replaced(self, url):
        """Wait until another node replaces the killed one at this address."""
        self._until(lambda states: url not in self.nodes() and ready(states) == 2)

    def until_ready(self):
        """Wait for both nodes; one may have been started a moment ago."""
        self._until(lambda states: ready(states) == 2)

    def _until(self, good, seconds=120):
        ends_at = time.monotonic() + seconds
        while not good(states := self._states()):
            assert time.monotonic() < ends_at, states
            time.sleep(0.05)
        return states

    @contextlib.contextmanager
    def drained_meanwhile(self):
        """Drain the node of the first agent that comes; its session moves to the other one."""
        with ThreadPoolExecutor() as pool:
            done = pool.submit(self._drain)
            yield
            done.result(timeout=30)

    def _drain(self):
        """A new node takes its place."""
        name = self._walked_on()
        httpx.post(f"{self.url}/v1/cluster/nodes/{name}/drain").raise_for_status()
        self._until(lambda states: name not in [one["node"]["name"] for one in states])
        self._process.stdin.write("add\n")
        self._process.stdin.flush()

    def _walked_on(self):
        """The name of the node with agents, once they walk, and clients that test a lost connection
        have done so.
        """
        states = self._until(lambda states: ready(states) == 2 and any(map(busy, states)))
        time.sleep(2.5)
        return next(one["node"]["name"] for one in states if busy(one))


def busy(state):
    return state["load"]["agents"] > 0


def ready(states):
    return sum(one["load"]["ready"] and one["lease_left_s"] > 0 for one in states)


async def run():
    """A cluster that gets one more node for each line, until there are none."""
    async with LocalCluster(nodes=2) as cluster:
        sys.stdout.write(json.dumps([cluster.entry.http_url, cluster.entry.grpc_address]) + "\n")
        sys.stdout.flush()
        while await asyncio.to_thread(sys.stdin.readline):
            cluster.add_node()


if __name__ == "__main__":
    asyncio.run(run())
