"""Nodes in this process, with real servers, streams and moves: node after node is drained."""

import asyncio
import contextlib
import os

import numpy as np
import pytest

from tests.cluster.nodes import Link, info
from tests.cluster.watchers import Watcher, go_on
from tests.runtime.kept_worlds import fake_worlds
from wayfarer.cluster.directory import LeaseRules
from wayfarer.cluster.entry import Entry
from wayfarer.cluster.node_agent import joined
from wayfarer.cluster.node_lease import NodeLease
from wayfarer.config.limits import Limits
from wayfarer.config.settings import Settings
from wayfarer.runtime.live import steady_clock
from wayfarer.runtime.motion_service import MotionService
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.server import Server
from wayfarer_client import Client

ROUNDS = int(os.environ.get("WAYFARER_TEST_DRAINS", "2"))
LATE_S = 1.0
"""Seconds that the motion thread of a node with much to do takes to describe an agent."""


class Cluster:
    """Implements `NodeLink`."""

    def __init__(self):
        self.link, self.agents, self.ended = Link(LeaseRules(60.0)), {}, {}
        self.link.directory._settled_at = 0.0
        self._lives = {}

    async def __aenter__(self):
        self.entry = Entry(Settings(http_port=0, grpc_port=0, drain_s=0.2), self.link, self, print)
        await self.entry.start()
        return self

    async def __aexit__(self, *_):
        await self.entry.stop()
        for life in self._lives.values():
            await life.aclose()

    async def call(self, node, verb, *told, seconds=0):
        return await getattr(self.agents[node.name], verb)(*told)

    async def add(self, name):
        clock, lease = steady_clock(), NodeLease(info(name))
        runtime = MotionService(fake_worlds(), clock=clock, may_step=lease.may_step)
        ended = self.ended[name] = asyncio.Event()
        gateway = Gateway(runtime, BodyLibrary("anny52"), Limits(), clock, ended.set, lease)
        server, describe = Server(gateway, "127.0.0.1", 0, 0), runtime.get_agent

        async def late(agent_id):
            await asyncio.sleep(LATE_S)
            return await describe(agent_id)

        runtime.get_agent = late
        runtime.start()
        await server.start()
        life = self._lives[name] = contextlib.AsyncExitStack()
        life.push_async_callback(runtime.stop)
        life.push_async_callback(server.stop)
        await server.until_ready()
        node = joined(self.link, self, lease, gateway, server.ports, ended.set)
        self.agents[name] = await life.enter_async_context(node)
        async with asyncio.timeout(20):
            while not (lease.leased and self.link.directory._nodes[name].load.ready):
                await asyncio.sleep(0.02)

    async def drain(self, name):
        self.link.directory.drain(name)
        async with asyncio.timeout(60):
            await self.ended[name].wait()
        await self._lives.pop(name).aclose()
        self.link.directory.ended(name)


@pytest.mark.asyncio
async def test_streams_go_on_without_a_gap_though_the_node_that_takes_them_is_busy():
    async with Cluster() as cluster, Client(cluster.entry.grpc_address) as client:
        await cluster.add("n0")
        for number in range(ROUNDS):
            watched = [await Watcher.of(client) for _ in range(6)]
            await go_on(watched)
            await cluster.add(f"n{number + 1}")
            for one in watched:
                one.clear()
            await cluster.drain(f"n{number}")
            await go_on(watched, 10)
            for one in watched:
                assert one.events == [], one.details
                assert set(np.diff(one.seqs)) == {1}, "every primitive came, and once"
                assert one.stream.reconnections
                await one.close()
                await one.session.delete()
