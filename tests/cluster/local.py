"""A cluster of a few nodes on a Ray of this process, with its entry."""

import asyncio
import contextlib
import json
import os
import shutil
import subprocess
from pathlib import Path

import psutil
import pytest

from tests.serving import free_port
from wayfarer.cluster.directory import LeaseRules
from wayfarer.cluster.entry import Entry
from wayfarer.cluster.messages import NodePlan
from wayfarer.commands.serve import NODE
from wayfarer.config.settings import Settings
from wayfarer.errors import Unavailable

LEASE_S = 3.0
STORE = "redis-server"
HAS_STORE = shutil.which(STORE) is not None
assert HAS_STORE or not os.environ.get("CI"), f"no {STORE}"


class LocalCluster:
    """As an asynchronous context manager; its nodes are ready inside."""

    def __init__(self, nodes=3, store=False, **settings):
        """`store`: Ray's head keeps its state, and can be started again."""
        self._store = store
        self.settings = Settings(
            http_port=0, grpc_port=0, engine="onnxruntime", threads=1, candidates=2,
            admission=False, drain_s=0.5,
            limits={"agents": 704, "agents_per_session": 32, "sessions_per_caller": 48},
            log_format="json", **settings,
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
        self._redis = self._head = None
        self._others = processes()  # of tests before, in the same process
        with pytest.MonkeyPatch.context() as patch:
            if self._store:
                port = free_port()
                command = [STORE, "--port", str(port), "--bind", "127.0.0.1", "--save", ""]
                self._redis = subprocess.Popen(command, stdout=subprocess.DEVNULL)
                patch.setenv("RAY_REDIS_ADDRESS", f"127.0.0.1:{port}")
            try:
                self._ray = RayCluster()
            except BaseException:  # Ray does not start on a machine without a core to spare
                if self._redis:
                    self._redis.kill()
                raise
        self.link = self._ray.directory(LeaseRules(LEASE_S))
        for _ in range(self._count):
            self.add_node()
        self.entry = self.new_entry(self.settings)
        await self.entry.start()
        try:
            await self.until(lambda status: self.ready(status) == self._count)
        except BaseException:  # a busy machine; nothing is left behind
            await self.__aexit__()
            raise
        return self

    async def __aexit__(self, *_):
        await self.entry.stop()
        below = [one for one in processes() if one not in self._others]
        self._ray.close()
        own = [one for one in (self._head, self._redis) if one is not None]
        for one in own:
            one.kill()
            one.wait()
        left = psutil.wait_procs(
            [one for one in below if one.pid not in [mine.pid for mine in own]], 20
        )[1]
        assert not [one for one in left if lives(one)], "a process is left over"

    def kill(self, name):
        """A process of Ray, by a part of its command."""
        one = processes(name)[0]
        told = one.cmdline(), one.environ()
        one.kill()
        one.wait(10)
        return told

    def kill_head(self):
        self._told = self.kill("gcs_server")

    def start_head(self):
        """As it was, at the address that it had."""
        (command, environment), port = self._told, self._ray._head.rpartition(":")[2]
        at = [f"--gcs_server_port={port}" if "gcs_server_port" in word else word
              for word in command]  # fmt: skip
        self._head = subprocess.Popen(at, env=environment, stdout=subprocess.DEVNULL)

    def head_answers(self):
        return self._ray.head_answers()

    def owner(self, session):
        """Name of its node, as far as the entry knows."""
        return self.entry.finder._view.owner(session.session_id).name

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
        """The process of a node."""
        nodes = (await self.status()).nodes
        port = next(one.node.grpc_port for one in nodes if one.node.name == name)
        return next(one for one in processes("NodeActor") if port in listening(one))

    def said(self):
        """What nodes logged, as dictionaries, in the order of time."""
        files = Path(self._ray.logs).glob("worker*.err")
        found = [line for file in files for line in lines(file.read_text())]
        return sorted(found, key=lambda line: line["timestamp"])


def processes(name="", of=None):
    """Below a process, by a part of the command; Ray's actors by their class."""
    found = []
    with contextlib.suppress(psutil.NoSuchProcess):  # it has ended itself
        for one in psutil.Process(of).children(recursive=True):
            with contextlib.suppress(psutil.Error):  # it has just ended
                if name in " ".join(one.cmdline()):
                    found.append(one)
    return found


def lives(process):
    """Not so where a process has ended and the machine's first one has not asked how."""
    with contextlib.suppress(psutil.NoSuchProcess):
        return process.status() != psutil.STATUS_ZOMBIE
    return False


def listening(process):
    return [one.laddr.port for one in process.net_connections() if one.status == "LISTEN"]


def lines(text):
    for line in text.splitlines():
        with contextlib.suppress(ValueError):
            if isinstance(found := json.loads(line), dict):
                yield found
